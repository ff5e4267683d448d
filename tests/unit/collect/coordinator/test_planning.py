"""Several processes check a large plan, with the same result as one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from throwcollect.collect.coordinator import prepare
from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.config.schema import Config
from throwcollect.errors import Interrupted

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


def test_a_reporter_gets_the_progress_of_a_plan_and_can_interrupt_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prepare, "_REPORT_FIRST_S", 0.0)
    monkeypatch.setattr(prepare, "_REPORT_EVERY_S", 0.0)
    config = Config.model_validate({**CONFIG, "trials": 250})
    told: list[str] = []

    class Impatient(Reporter):
        def say(self, line: str) -> None:
            told.append(line)
            if len(told) == 2:
                raise Interrupted("enough")

    with pytest.raises(Interrupted, match="enough"):
        prepare.prepare(config, tmp_path / "data", sweep_directory=tmp_path, reporter=Impatient())
    assert told == [f"plan: {checked} of 250 trials checked" for checked in (100, 200)]
    assert not (tmp_path / "data").exists()
