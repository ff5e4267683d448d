"""Directories of single processes: private, and removed after their process, however that ends."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from throwcollect.own_directory import make_own_directory

PREFIX = "throwcollect-test-"
LATER_S = 120.0
KILLED = f"""
import os, signal
from throwcollect.own_directory import make_own_directory
with make_own_directory({PREFIX!r}) as path:
    (path / "key").touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary files lie."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def grow_old(directory: Path) -> None:
    then = time.time() - LATER_S
    os.utime(directory, (then, then))


def test_an_own_directory_is_private_and_removed_afterwards(place: Path) -> None:
    with make_own_directory(PREFIX) as path:
        assert stat.S_IMODE(path.stat().st_mode) == 0o700
        (path / "key").touch()
    assert not list(place.iterdir())


def test_the_directory_of_a_killed_process_is_removed_by_the_next_process(place: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED], env={**os.environ, "TMPDIR": str(place)}, check=False)
    (left,) = place.iterdir()
    assert (left / "key").exists()
    with make_own_directory(PREFIX):
        # A young directory may belong to a process that has not locked it yet.
        assert left.exists()
    grow_old(left)
    with make_own_directory(PREFIX):
        assert not left.exists()


def test_the_directory_of_a_living_process_is_kept(place: Path) -> None:
    with make_own_directory(PREFIX) as first:
        grow_old(first)
        with make_own_directory(PREFIX):
            assert first.exists()


def test_links_files_and_other_directories_are_not_removed(place: Path) -> None:
    (place / "elsewhere").mkdir()
    (place / "elsewhere" / "file").touch()
    (place / f"{PREFIX}link").symlink_to(place / "elsewhere")
    (place / f"{PREFIX}file").touch()
    for each in place.iterdir():
        os.utime(each, (0, 0), follow_symlinks=False)
    before = sorted(place.rglob("*"))
    with make_own_directory(PREFIX):
        pass
    assert sorted(place.rglob("*")) == before
