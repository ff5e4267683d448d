"""A large plan is checked by several processes, and is the one that one process makes."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect.config.schema import Config
from throwcollect.coordinator import prepare
from throwcollect.errors import PlanError

CONFIG = {
    "name": "many",
    "trials": 60,
    "sweep": {"sampler": "uniform", "parameters": {"task.duration_s": {"min": 0.2, "max": 1.2}}},
}


def test_the_plan_is_the_same_whoever_checks_it(monkeypatch: pytest.MonkeyPatch) -> None:
    config = Config.model_validate(CONFIG)
    alone = prepare.draw_plan(config, directory=Path())
    monkeypatch.setattr(prepare, "_MANY_TRIALS", 50)
    assert any(trial.refused for trial in alone.trials)
    assert not all(trial.refused for trial in alone.trials)
    assert prepare.draw_plan(config, directory=Path(), processes=2) == alone


def test_a_plan_of_which_no_trial_is_left_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "_MANY_TRIALS", 50)
    impossible = {**CONFIG, "sweep": {"parameters": {"task.duration_s": {"min": 0.1, "max": 0.12}}}}
    with pytest.raises(PlanError, match=r"60 trials, all refused"):
        prepare.draw_plan(Config.model_validate(impossible), directory=Path(), processes=2)
