"""A process with the packages of `tests/plugins`: one for many commands, as each takes a second to start."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.collection import call_here

PLUGINS = Path(__file__).parents[1] / "plugins"


@contextmanager
def process_with_plugins(packages: Path = PLUGINS) -> Iterator[ProcessPoolExecutor]:
    """A process that finds the packages of a directory, as do its children; it runs the functions that it is given."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PYTHONPATH", str(packages), prepend=os.pathsep)
            patch.setattr(sys, "path", [str(packages), *sys.path])
            # The process starts with its first function, while the path is patched.
            assert process.submit(call_here, "--version").result().returncode == 0
        yield process


def run_program(program: str, **names: Any) -> dict[str, Any]:
    """Run a program with the given names; returns its variable ``found`` after the way through JSON."""
    exec(program, names)  # noqa: S102
    found: dict[str, Any] = json.loads(json.dumps(names["found"]))
    return found
