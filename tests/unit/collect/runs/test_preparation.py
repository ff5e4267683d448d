"""The default directory of a dataset, refused arguments, and a resume that fails."""

import re
from pathlib import Path

import pytest
from tests.e2e.collection import FAST, collect_here, write_config

from throwcollect.collect.runs.preparation import _name_directory, resume
from throwcollect.errors import ThrowcollectError
from throwcollect.state_directory import STATE_VARIABLE


def test_the_default_directory_gets_a_time_if_the_plain_name_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plain = Path("datasets/quick")
    assert _name_directory("quick") == plain
    plain.mkdir(parents=True)
    assert _name_directory("quick") == plain
    (plain / "plan.parquet").touch()
    assert re.fullmatch(r"datasets/quick-\d{8}-\d{6}", str(_name_directory("quick")))
    (tmp_path / "datasets/link").symlink_to("nowhere")
    assert _name_directory("link") != Path("datasets/link")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished dataset."""
    directory = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(STATE_VARIABLE, str(directory / "state"))
        collect_here(write_config(directory, trials=3, sim=FAST), directory / "data")
    return directory / "data"


def read_files(directory: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("overrides", "problem"),
    [
        (["run.runtime=docker"], "no Docker engine answers"),
    ],
)
def test_a_failed_resume_leaves_a_finished_dataset_unchanged(
    overrides: list[str], problem: str, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    monkeypatch.setenv("DOCKER_HOST", "unix:///nowhere.sock")
    before = read_files(finished)
    with pytest.raises(ThrowcollectError, match=problem):
        resume(finished, overrides=["trials=5", *overrides])
    assert read_files(finished) == before
    assert resume(finished) is None
