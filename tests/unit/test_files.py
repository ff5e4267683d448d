"""Files and directories that appear whole or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from throwcollect.files import new_directory


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o755), (0o077, 0o700), (0o002, 0o775)])
def test_a_new_directory_has_the_permissions_that_the_user_gives_to_others(
    umask: int, mode: int, tmp_path: Path
) -> None:
    before = os.umask(umask)
    try:
        with new_directory(tmp_path / "new") as place:
            (place / "file").touch()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == mode


def test_the_rest_that_a_killed_process_left_of_a_new_directory_is_removed(tmp_path: Path) -> None:
    killed = """
import os, pathlib, signal, sys
from throwcollect.files import new_directory
with new_directory(pathlib.Path(sys.argv[1])) as place:
    (place / "file").touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    path = tmp_path / "new"
    subprocess.run([sys.executable, "-c", killed, path], check=False)
    (left,) = tmp_path.iterdir()
    with new_directory(path):
        assert not list(left.rglob("file"))
    assert [each.name for each in tmp_path.iterdir()] == ["new"]
    assert not list(path.iterdir())
