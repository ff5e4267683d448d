"""The state directory, which holds the records of a user's runs: nobody else can write there."""

import os
from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.state_directory import STATE_VARIABLE, state_directory


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


def test_the_default_state_directory_is_private_to_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(STATE_VARIABLE, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    state_directory()
    directory = tmp_path / f"throwcollect-{os.getuid()}"
    assert directory.stat().st_mode & 0o777 == 0o700
    directory.chmod(0o777)
    with pytest.raises(ConfigError, match="belongs to another user, or others may write there"):
        state_directory()


@pytest.mark.parametrize(("permissions", "taken"), [(0o755, True), (0o775, False), (0o757, False), (0o1777, False)])
def test_a_named_state_directory_that_others_can_write_is_refused(state: Path, permissions: int, taken: bool) -> None:
    state.mkdir()
    state.chmod(permissions)
    if taken:
        state_directory()
    else:
        with pytest.raises(ConfigError, match="belongs to another user, or others may write there"):
            state_directory()


def test_a_link_that_is_named_as_state_directory_is_followed(state: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    state.symlink_to(tmp_path / "elsewhere")
    assert state_directory().samefile(tmp_path / "elsewhere")


def test_a_link_in_place_of_the_default_state_directory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(STATE_VARIABLE, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / f"throwcollect-{os.getuid()}").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ConfigError, match="belongs to another user, or others may write there"):
        state_directory()
