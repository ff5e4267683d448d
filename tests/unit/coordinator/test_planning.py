"""Several processes check a large plan, with the same result as one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator import prepare
from throwcollect.coordinator.onlooker import Onlooker
from throwcollect.errors import ConfigError, Interrupted, PlanError

CONFIG: dict[str, Any] = {
    "name": "many",
    "trials": 60,
    "sweep": {"sampler": "uniform", "parameters": {"task.duration_s": {"min": 0.2, "max": 1.2}}},
}


def test_two_processes_make_the_same_plan_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    config = Config.model_validate(CONFIG)
    alone = prepare.draw_plan(config, directory=Path())
    monkeypatch.setattr(prepare, "_MANY_TRIALS", 50)
    assert any(trial.refused for trial in alone.trials)
    assert not all(trial.refused for trial in alone.trials)
    assert prepare.draw_plan(config, directory=Path(), processes=2) == alone


def test_a_plan_whose_trials_are_all_refused_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "_MANY_TRIALS", 50)
    impossible = {**CONFIG, "sweep": {"parameters": {"task.duration_s": {"min": 0.1, "max": 0.12}}}}
    with pytest.raises(PlanError, match=r"60 trials, all refused"):
        prepare.draw_plan(Config.model_validate(impossible), directory=Path(), processes=2)


def test_a_used_directory_is_refused_before_trials_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "draw_points", lambda *_, **__: pytest.fail("points are drawn"))
    (tmp_path / "notes.txt").touch()
    for directory, reason in ((tmp_path, "holds notes.txt"), (tmp_path / "notes.txt", "cannot be used")):
        with pytest.raises(ConfigError, match=reason):
            prepare.prepare(Config.model_validate(CONFIG), directory, sweep_directory=tmp_path)


@pytest.mark.parametrize("change", [{"trials": 30_001}, {"trials": None, "until": {"landed": 3001}}])
def test_a_dataset_of_too_many_files_is_refused_before_trials_are_checked(
    change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepare, "feasibility_check", lambda _: pytest.fail("trials are checked"))
    sampler = {"sweep": {**CONFIG["sweep"], "sampler": "sobol"}}
    config = Config.model_validate({**CONFIG, **sampler, **change, "record": {"trials_per_shard": 1}})
    with pytest.raises(ConfigError, match=r"record.trials_per_shard: 300.. trials would be in 300.. files") as caught:
        prepare.draw_plan(config, directory=Path())
    assert caught.value.expected == "at most 30000 files, so 2 trials a file or more"


def test_an_onlooker_follows_the_progress_of_a_plan_and_can_interrupt_it(tmp_path: Path) -> None:
    config = Config.model_validate({**CONFIG, "trials": 250})
    told: list[tuple[int, int]] = []

    class Impatient(Onlooker):
        def update_plan(self, checked: int, trials: int) -> None:
            told.append((checked, trials))
            if checked == 200:
                raise Interrupted("enough")

    with pytest.raises(Interrupted, match="enough"):
        prepare.prepare(config, tmp_path / "data", sweep_directory=tmp_path, onlooker=Impatient())
    assert told == [(0, 250), (0, 250), (100, 250), (200, 250)]
    assert not (tmp_path / "data").exists()
