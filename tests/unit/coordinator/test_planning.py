"""Several processes check a large plan, with the same result as one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.unit.coordinator.listener import Listener

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


def test_drawing_and_checking_of_a_large_plan_are_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "_ANNOUNCED_TRIALS", 400)
    monkeypatch.setattr(prepare, "_MOST_PIECES", 1)
    monkeypatch.setattr(prepare, "_TELL_FIRST_S", 0.0)
    monkeypatch.setattr(prepare, "feasibility_check", lambda _: lambda _: None)
    told = Listener()
    config = Config.model_validate({**CONFIG, "trials": 450})
    assert len(prepare.draw_plan(config, directory=Path(), onlooker=told).trials) == 450
    assert told.said == ["plan: draws 450 trials", "plan: checks 450 trials", "plan: 100 of 450 trials checked"]
    told.said.clear()
    prepare.draw_plan(Config.model_validate({**CONFIG, "trials": 399}), directory=Path(), onlooker=told)
    assert told.said[0].endswith("of 399 trials checked")
    assert told.warnings == []


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


def test_a_robot_below_the_ground_gives_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    def list_warnings(height_m: float) -> list[str]:
        listener = Listener()
        config = Config.model_validate({**CONFIG, "trials": 1, "robot": {"base_height_m": height_m}})
        monkeypatch.setattr(prepare, "feasibility_check", lambda _: lambda _: None)
        prepare.draw_plan(config, directory=Path(), onlooker=listener)
        assert listener.said == []
        return listener.warnings

    assert list_warnings(0.5) == [
        "warning: robot.base_height_m: 0.5: leg_left_6_link is 0.52 m below the ground at the start; "
        "the robot stands on it at 1.020"
    ]
    assert list_warnings(1.015) == list_warnings(1.5) == list_warnings(1.01927) == []
