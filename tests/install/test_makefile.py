"""`make` on machines that differ from ours, with stand-ins for the programs that it installs and calls."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="needs make")


@pytest.fixture(params=["clone", "it's a $clone"])
def clone(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A directory with the Makefile, and an environment in which everything is installed."""
    path = tmp_path / str(request.param)
    (path / ".venv" / "bin").mkdir(parents=True)
    for name in ("Makefile", "pyproject.toml", "uv.lock"):
        shutil.copy(ROOT / name, path)
    (path / ".venv" / "bin" / "python").symlink_to(sys.executable)
    program = path / ".venv" / "bin" / "throwcollect"
    program.write_text('#!/bin/sh\necho "throwcollect $*"\n')
    program.chmod(0o755)
    (path / ".venv" / ".ready").touch()
    return path


def make(directory: Path, target: str) -> subprocess.CompletedProcess[str]:
    # This `make` must not count as part of the one that may run the tests.
    variables = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    variables["PATH"] = "/usr/bin:/bin"
    return subprocess.run(
        ["make", "-s", target], cwd=directory, env=variables, capture_output=True, text=True, timeout=60, check=False
    )


def test_make_up_works_in_a_clone_at_any_path(clone: Path) -> None:
    done = make(clone, "up")
    assert done.returncode == 0, done.stderr
    collected, hint = done.stdout.splitlines()
    assert collected.startswith("throwcollect up -n 2 configs/quickstart.yaml")
    assert hint == f'so that the shell finds throwcollect: export PATH="{clone}/.venv/bin:$PATH"'
