"""A prepared run can be launched only once."""

from __future__ import annotations

from pathlib import Path

import pytest

from throwcollect import runs
from throwcollect.errors import ConflictError
from throwcollect.runs.prepared_run import PreparedRun
from throwcollect.runs.state_directory import STATE_VARIABLE

YAML = """\
trials: 1
sim: {engine: ballistic}
run: {runtime: inprocess, replay: 0}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}
"""

launched_again = pytest.mark.parametrize("launch", [PreparedRun.collect, PreparedRun.start])


@pytest.fixture
def prepared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> PreparedRun:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    (tmp_path / "small.yaml").write_text(YAML)
    return runs.prepare(tmp_path / "small.yaml", output=tmp_path / "data")


@launched_again
def test_launching_a_prepared_run_twice_is_refused(prepared: PreparedRun, launch) -> None:
    with prepared as run:
        summary = run.collect()
        with pytest.raises(ConflictError, match=f"run {run.record.run}: was launched already"):
            launch(run)
    with pytest.raises(ConflictError, match=f"run {run.record.run}: was launched already"):
        launch(run)
    assert runs.wait(runs.find(run.record.run)) == summary


@launched_again
def test_launching_a_prepared_run_after_its_block_is_refused(prepared: PreparedRun, launch, tmp_path: Path) -> None:
    with prepared as run:
        pass
    with pytest.raises(ConflictError, match=f"run {run.record.run}: was given up when its block was left"):
        launch(run)
    assert not (tmp_path / "data").exists()
