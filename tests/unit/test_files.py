"""Files and directories that appear whole or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from throwcollect.errors import ConfigError, DatasetError
from throwcollect.files import beside, new_directory, replacing, write_all, write_file


def write_twice(path: Path) -> None:
    with beside(path) as first:
        write_all(first, b"first")
        with beside(path) as second:
            write_all(second, b"the second one")


def test_of_two_writers_of_one_file_the_last_succeeds_and_the_other_fails(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with pytest.raises(OSError, match="another process writes it, too"):
        write_twice(path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_bytes() == b"the second one"


def test_the_loser_of_two_writers_is_told_of_the_other_one(tmp_path: Path) -> None:
    page, directory = tmp_path / "page.html", tmp_path / "new"
    too_late = pytest.raises(DatasetError, match=r"page\.html: cannot be written: another process writes it, too")
    with too_late, replacing(page):
        write_file(page, b"the other one")
    too_late = pytest.raises(DatasetError, match="new: cannot be written: another process has filled it meanwhile")
    with too_late, new_directory(directory), new_directory(directory) as other:
        (other / "file").touch()
    assert [each.name for each in directory.iterdir()] == ["file"]


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


def test_an_existing_directory_keeps_its_permissions(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine").chmod(0o2750)
    with new_directory(tmp_path / "mine"):
        pass
    assert stat.S_IMODE((tmp_path / "mine").stat().st_mode) == 0o2750


def test_replacing_the_working_directory_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for spelling in (Path(), tmp_path):
        with pytest.raises(ConfigError, match="is the working directory"), new_directory(spelling):
            pytest.fail("it began")


def test_a_link_to_an_empty_directory_is_refused_as_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with pytest.raises(ConfigError, match="link: is a symbolic link"), new_directory(tmp_path / "link"):
        pytest.fail("it began")


def test_the_rest_that_a_killed_process_left_of_a_new_directory_is_removed(tmp_path: Path) -> None:
    killed = """
import os, pathlib, signal, sys
from throwcollect.files import new_directory
with new_directory(pathlib.Path(sys.argv[1])) as place:
    (place / "file").touch()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    # The name has a character that means others in a pattern.
    path = tmp_path / "new[1]"
    subprocess.run([sys.executable, "-c", killed, path], check=False)
    (left,) = tmp_path.iterdir()
    (tmp_path / ".new[1].backups").mkdir()
    for each in tmp_path.iterdir():
        os.utime(each, (0, 0))
    with new_directory(path):
        assert not left.exists()
    assert {each.name for each in tmp_path.iterdir()} == {"new[1]", ".new[1].backups"}


def test_an_error_in_a_new_directory_names_the_file_as_it_would_have_been_called(tmp_path: Path) -> None:
    def fail(file: str) -> None:
        with new_directory(tmp_path / "new") as outer, new_directory(outer / "part") as inner:
            raise DatasetError("cannot be written", path=inner / file, place="byte 17", hint="free space")

    with pytest.raises(DatasetError) as caught:
        fail("plan.parquet")
    assert (caught.value.path, caught.value.hint) == (tmp_path / "new" / "part" / "plan.parquet", "free space")
    assert caught.value.message == f"{tmp_path}/new/part/plan.parquet: byte 17: cannot be written"
    # A file elsewhere, such as one of the source, keeps its name.
    with pytest.raises(DatasetError, match=f"^{tmp_path}/source: byte 17: cannot be written"):
        fail(str(tmp_path / "source"))
    assert list(tmp_path.iterdir()) == []
