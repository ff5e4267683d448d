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


def test_an_onlooker_follows_the_progress_of_a_plan_and_can_interrupt_it(tmp_path: Path) -> None:
    config = Config.model_validate({**CONFIG, "trials": 250})
    told: list[tuple[int, int]] = []

    class Impatient(Reporter):
        def update_plan(self, checked: int, trials: int) -> None:
            told.append((checked, trials))
            if checked == 200:
                raise Interrupted("enough")

    with pytest.raises(Interrupted, match="enough"):
        prepare.prepare(config, tmp_path / "data", sweep_directory=tmp_path, reporter=Impatient())
    assert told == [(0, 250), (0, 250), (100, 250), (200, 250)]
    assert not (tmp_path / "data").exists()
