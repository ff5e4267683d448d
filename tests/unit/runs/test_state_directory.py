"""The directory of what is remembered of a user's runs: nobody else can put anything there."""

import os
from pathlib import Path

import pytest

from throwcollect.errors import ConfigError
from throwcollect.runs.state_directory import STATE_VARIABLE, state_directory


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


def test_by_default_the_state_is_the_users_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(STATE_VARIABLE, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    state_directory()
    directory = tmp_path / f"throwcollect-{os.getuid()}"
    assert directory.stat().st_mode & 0o777 == 0o700
    directory.chmod(0o777)
    with pytest.raises(ConfigError, match="belongs to somebody else, or others may write there"):
        state_directory()


@pytest.mark.parametrize(("permissions", "taken"), [(0o755, True), (0o775, False), (0o757, False), (0o1777, False)])
def test_a_named_directory_may_be_read_by_others_but_not_written(state: Path, permissions: int, taken: bool) -> None:
    state.mkdir()
    state.chmod(permissions)
    if taken:
        state_directory()
    else:
        with pytest.raises(ConfigError, match="belongs to somebody else, or others may write there"):
            state_directory()


def test_a_link_that_the_user_has_named_is_followed(state: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    state.symlink_to(tmp_path / "elsewhere")
    assert state_directory().samefile(tmp_path / "elsewhere")


def test_a_link_that_somebody_else_has_laid_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(STATE_VARIABLE, raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    (tmp_path / f"throwcollect-{os.getuid()}").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ConfigError, match="belongs to somebody else, or others may write there"):
        state_directory()


def test_a_state_directory_that_is_none_is_named_with_a_way_out(state: Path) -> None:
    state.write_text("a file")
    with pytest.raises(ConfigError, match=f"{state}.*: runs cannot be remembered there: ") as caught:
        state_directory()
    assert "name another directory in THROWCOLLECT_STATE" in str(caught.value)
