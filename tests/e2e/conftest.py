"""Runs of tests are remembered apart from those of the user, and their processes have what the extras bring alone."""

import os
from collections.abc import Iterator

import pytest

from tests.commands import command_server
from throwcollect.runs.state_directory import STATE_VARIABLE


@pytest.fixture(scope="session", autouse=True)
def environment(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    # Arrow imports pandas wherever that is installed, which takes each process a quarter of a second.
    extras_alone = tmp_path_factory.mktemp("extras")
    (extras_alone / "pandas.py").write_text("raise ImportError('no extra brings pandas')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(tmp_path_factory.mktemp("state")))
        patch.setenv("PYTHONPATH", str(extras_alone), prepend=os.pathsep)
        with command_server():
            yield
