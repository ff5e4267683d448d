"""What resuming needs to find in the directory of a dataset, and what it restores."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from tests.unit.dataset.damage import change_table
from tests.unit.dataset.kills import KilledEverywhere

from throwcollect.collect.coordinator.prepare import prepare
from throwcollect.collect.coordinator.resume import prepare_or_resume, resume
from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError, PlanError

SETTINGS: dict[str, Any] = {
    "name": "small",
    "trials": 4,
    "sweep": {"parameters": {"task.duration_s": {"min": 1.0, "max": 1.2}, "ball.mass_kg": {"min": 0.03, "max": 0.06}}},
}


def config_with(**changes: Any) -> Config:
    return Config.model_validate({**SETTINGS, **changes})


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    directory = tmp_path_factory.mktemp("prepared") / "data"
    prepare(config_with(), directory, sweep_directory=directory)
    return contents(directory)


@pytest.fixture
def directory(prepared: dict[str, bytes], tmp_path: Path) -> Path:
    for name, content in prepared.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def contents(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def test_resuming_an_undamaged_dataset_changes_no_file(directory: Path, prepared: dict[str, bytes]) -> None:
    plan = resume(config_with(), directory, sweep_directory=directory)
    assert len(plan.trials) == 4
    assert contents(directory) == prepared


def test_resume_accepts_swept_keys_in_another_order(directory: Path, prepared: dict[str, bytes]) -> None:
    parameters = dict(reversed(SETTINGS["sweep"]["parameters"].items()))
    other = config_with(run={"simulations": 7}, sweep={"parameters": parameters})
    for _ in range(2):
        plan = resume(other, directory, sweep_directory=directory)
        assert list(plan.config.sweep.parameters) == list(SETTINGS["sweep"]["parameters"])
    assert contents(directory)["plan.parquet"] == prepared["plan.parquet"]
    assert load(directory / "config.yaml").run.simulations == 7


def test_resume_refuses_other_changed_keys_and_names_them_all(directory: Path, prepared: dict[str, bytes]) -> None:
    other = config_with(ball={"radius_m": 0.03}, seed=5)
    with pytest.raises(ConfigError, match="the same configuration") as raised:
        resume(other, directory, sweep_directory=directory)
    assert [str(problem) for problem in raised.value.problems] == [
        f"seed: {directory} was begun with 0, got 5",
        f"ball.radius_m: {directory} was begun with 0.025, got 0.03",
    ]
    assert contents(directory) == prepared


def test_resume_with_more_trials_continues_the_plan(directory: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    before = resume(config_with(), directory, sweep_directory=directory)
    after = resume(config_with(trials=6), directory, sweep_directory=directory)
    assert after.trials[:4] == before.trials
    fresh = tmp_path_factory.mktemp("fresh") / "data"
    prepare(config_with(trials=6), fresh, sweep_directory=fresh)
    assert contents(directory) == contents(fresh)


@pytest.mark.parametrize("length", [None, 0, 100])
def test_a_missing_or_damaged_plan_is_made_again(
    directory: Path, prepared: dict[str, bytes], length: int | None
) -> None:
    plan = directory / "plan.parquet"
    plan.unlink() if length is None else plan.write_bytes(prepared["plan.parquet"][:length])
    resume(config_with(), directory, sweep_directory=directory)
    assert contents(directory) == prepared


@pytest.mark.parametrize(("column", "value"), [("task.duration_s", 1.1), ("seed", 42)])
def test_a_plan_whose_digests_do_not_fit_its_trials_is_made_again(
    directory: Path, prepared: dict[str, bytes], column: str, value: float
) -> None:
    change_table(directory / "plan.parquet", column, 2, value)
    resume(config_with(), directory, sweep_directory=directory)
    assert contents(directory) == prepared


@pytest.mark.parametrize("length", [None, 0, 500, -400])
def test_a_missing_or_damaged_configuration_is_restored_if_it_fits_the_plan(
    directory: Path, prepared: dict[str, bytes], length: int | None
) -> None:
    config = directory / "config.yaml"
    config.unlink() if length is None else config.write_bytes(prepared["config.yaml"][:length])
    with pytest.raises(DatasetError, match="the plan belongs to another configuration"):
        resume(config_with(seed=5), directory, sweep_directory=directory)
    resume(config_with(), directory, sweep_directory=directory)
    assert contents(directory) == prepared


def test_a_dataset_with_damaged_plan_and_configuration_is_refused(directory: Path) -> None:
    for path in directory.iterdir():
        path.write_bytes(b"")
    with pytest.raises(DatasetError, match=r"plan\.parquet: is damaged: "):
        resume(config_with(), directory, sweep_directory=directory)


def test_a_collection_of_which_only_recordings_and_journal_are_left_beside_the_configuration_goes_on(
    directory: Path, prepared: dict[str, bytes]
) -> None:
    DatasetWriter.open(directory).close()
    (directory / "plan.parquet").unlink()
    prepare_or_resume(directory / "config.yaml", directory)
    assert (directory / "plan.parquet").read_bytes() == prepared["plan.parquet"]


@pytest.mark.parametrize("begun", [False, True])
def test_a_kill_at_any_moment_of_planning_leaves_a_dataset_that_can_go_on(listed: Path, begun: bool) -> None:
    """The trials are those of a list; if the dataset was begun, its plan gets one more."""
    text = "name: listed\nsweep: {{sampler: list, file: lists/points.csv}}\ntrials: {}\n"
    few, more = listed / "few.yaml", listed / "more.yaml"
    few.write_text(text.format(2))
    more.write_text(text.format(3))
    prepare_or_resume(few, listed / "begun")
    wanted = prepare_or_resume(more, listed / "wanted")
    directory = listed / "data"
    if begun:
        shutil.copytree(listed / "begun", directory)
    with KilledEverywhere(directory, listed / "copies") as killed:
        prepare_or_resume(more, directory)
    assert len(killed.left) > 10
    # A file takes more calls than these steps, so the process dies before and after each.
    for left, _ in killed.left[::3]:
        # Until then, there is nothing but the configuration, and nothing to go on with.
        if begun or (left / "plan.parquet").exists():
            assert prepare_or_resume(more, left) == wanted
            assert contents(left) == contents(listed / "wanted")
        else:
            assert not (left / "trials.parquet").exists()


def test_a_growing_plan_can_be_resumed_with_higher_but_not_lower_numbers(tmp_path: Path) -> None:
    few, more = (config_with(trials=trials, until={"landed": landed}) for trials, landed in ((70, 60), (80, 65)))
    directory = tmp_path / "data"
    begun_with = prepare(few, directory, sweep_directory=tmp_path)
    (directory / "metadata.yaml").write_text("whole")
    plan = resume(more, directory, sweep_directory=tmp_path)
    assert plan.trials[: len(begun_with.trials)] == begun_with.trials
    assert load(directory / "config.yaml").until == more.until
    assert not (directory / "metadata.yaml").exists()
    with pytest.raises(ConfigError, match="the same configuration") as raised:
        resume(few, directory, sweep_directory=tmp_path)
    assert [problem.key for problem in raised.value.problems] == ["trials", "until.landed"]


LISTED = {"name": "listed", "sweep": {"sampler": "list", "file": "lists/points.csv"}}


@pytest.fixture
def listed(tmp_path: Path) -> Path:
    """A directory with a list of three points."""
    (tmp_path / "lists").mkdir()
    (tmp_path / "lists" / "points.csv").write_text("task.duration_s,ball.mass_kg\n1.0,0.03\n1.1,0.04\n1.2,0.05\n")
    return tmp_path


def test_a_dataset_keeps_a_copy_of_its_list_of_points(listed: Path) -> None:
    plan = prepare(Config.model_validate(LISTED), listed / "data", sweep_directory=listed)
    (listed / "lists" / "points.csv").unlink()
    own = load(listed / "data" / "config.yaml")
    assert own.sweep.file == "trials.parquet"
    again = prepare(own, listed / "again", sweep_directory=listed / "data")
    assert again == plan
    assert contents(listed / "again") == contents(listed / "data")


@pytest.mark.parametrize(("begun", "more"), [({"trials": 3}, {"trials": 4}), ({}, {})])
def test_resume_takes_points_that_were_added_to_the_list(
    listed: Path, begun: dict[str, int], more: dict[str, int]
) -> None:
    prepare(Config.model_validate({**LISTED, **begun}), listed / "data", sweep_directory=listed)
    with (listed / "lists" / "points.csv").open("a") as file:
        file.write("1.25,0.06\n")
    own = load(listed / "data" / "config.yaml").model_copy(update={"trials": 4})
    with pytest.raises(PlanError, match="at most 3, "):
        resume(own, listed / "data", sweep_directory=listed / "data")
    plan = resume(Config.model_validate({**LISTED, **more}), listed / "data", sweep_directory=listed)
    assert len(plan.trials) == 4
    fresh = prepare(Config.model_validate({**LISTED, **more}), listed / "fresh", sweep_directory=listed)
    assert plan == fresh
    assert contents(listed / "data") == contents(listed / "fresh")
