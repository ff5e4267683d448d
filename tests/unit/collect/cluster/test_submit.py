"""A submission that fails half way leaves no jobs behind."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.e2e.collection import CONFIG, FAST, write_config

from throwcollect.collect.cluster import slurm
from throwcollect.collect.cluster import submit as module
from throwcollect.collect.cluster.submit import submit
from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.errors import DatasetError


def test_jobs_are_cancelled_if_they_cannot_be_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise DatasetError("cannot be written: No space left on device")

    config = write_config(tmp_path, trials=4, text=CONFIG + "record: {{trials_per_shard: 2}}\n", sim=FAST)
    numbers, cancelled = iter("123"), list[str]()
    monkeypatch.setattr(slurm, "submit", lambda *_: next(numbers))
    monkeypatch.setattr(slurm, "cancel", cancelled.extend)
    monkeypatch.setattr(module, "write_submission", fail)
    with pytest.raises(DatasetError, match="No space left"):
        submit(config, tmp_path / "data", 2, reporter=SILENT)
    # The joining job waits for the end of the array, so it is the first one to be cancelled.
    assert cancelled == ["2", "1"]
    assert not (tmp_path / "data").exists()
