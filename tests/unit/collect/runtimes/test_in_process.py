"""Runs of the runtime `inprocess`: their datasets, and the ways in which they end."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.unit.work_side_by_side import begin_long

from throwcollect import load, runs
from throwcollect.collect.coordinator import replay_check
from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.runs.records import Records
from throwcollect.dataset.inspect import info
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.sim.simulator import Simulator as OneSimulator
from throwcollect.simulator import Simulator
from throwcollect.state_directory import STATE_VARIABLE

YAML = """\
name: small
trials: 3
seed: 7
run: {runtime: inprocess, replay: 0}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}
"""


class Reporter(runs.Reporter):
    """Remembers reports and warnings."""

    def __init__(self) -> None:
        self.reports: list[Progress] = []
        self.warnings: list[str] = []

    def update(self, progress: Progress) -> None:
        self.reports.append(progress)

    def warn(self, line: str) -> None:
        self.warnings.append(line)


@pytest.fixture
def yaml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    (tmp_path / "small.yaml").write_text(YAML)
    return tmp_path / "small.yaml"


def collect(
    yaml: Path, *overrides: str, reporter: runs.Reporter | None = None, interruptions: Callable[[], int] = lambda: 0
) -> runs.Summary:
    output = yaml.parent / "data"
    with runs.prepare(yaml, output=output, overrides=overrides, reporter=reporter or Reporter()) as run:
        return run.collect(interruptions=interruptions)


def test_an_inprocess_run_gives_the_throws_of_a_simulator(yaml: Path) -> None:
    before = dict(os.environ)
    reporter = Reporter()
    summary = collect(yaml, reporter=reporter)
    assert dict(os.environ) == before
    assert (summary.episodes, summary.digest) == (3, info(yaml.parent / "data").digest)
    with Simulator(yaml) as simulator:
        for throw in load(yaml.parent / "data"):
            again = simulator.throw({"task.duration_s": throw.row["task_duration_s"]}, trial=throw.trial)
            assert throw.row["digest"] == again.row["digest"]
    assert reporter.reports[-1].ended == 3
    assert reporter.warnings == []


def test_an_inprocess_run_writes_a_record_and_events(yaml: Path) -> None:
    summary = collect(yaml)
    run = runs.find(yaml.parent / "data")
    assert (run.status, run.record.runtime, run.record.simulations) == ("ended", "inprocess", 1)
    assert (run.record.summary, run.record.error) == (summary, None)
    assert run.record.progress is not None
    assert run.record.progress.outcomes == {"landed": 3}
    assert runs.wait(run) == summary
    events = [json.loads(line) for line in (yaml.parent / "data" / "logs" / "events.jsonl").read_text().splitlines()]
    assert [(each.get("node"), each["event"]) for each in events] == [
        (None, "started"),
        ("sim_0", "started"),
        ("coordinator", "started"),
        (None, "finished"),
    ]


def test_an_interrupted_inprocess_run_resumes_to_the_same_dataset(yaml: Path) -> None:
    reports: list[Progress] = []

    class Impatient(Reporter):
        def update(self, progress: Progress) -> None:
            reports.append(progress)

    with pytest.raises(Interrupted, match=r"finished throws are in .*/data, the dataset is not complete") as caught:
        collect(yaml, reporter=Impatient(), interruptions=lambda: len(reports))
    assert caught.value.hint == f"throwcollect resume {yaml.parent / 'data'}"
    assert 0 < reports[-1].ended < 3
    assert not (yaml.parent / "data" / "metadata.yaml").exists()
    resumed = runs.resume(yaml.parent / "data")
    assert resumed is not None
    with resumed as run:
        summary = run.collect()
    (yaml.parent / "other").mkdir()
    (yaml.parent / "other" / "small.yaml").write_text(YAML)
    assert collect(yaml.parent / "other" / "small.yaml").digest == summary.digest
    assert runs.resume(yaml.parent / "data") is None


def test_a_second_interruption_does_not_wait_for_the_replay_of_throws(
    yaml: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = [0]

    class Ended(Reporter):
        def update(self, progress: Progress) -> None:
            asked[0] = 2 * (progress.ended == progress.total)

    monkeypatch.setattr(replay_check, "_begin", begin_long)
    with pytest.raises(Interrupted, match=r"the throws are in .*, the dataset is not finished"):
        collect(yaml, "run.replay=1", reporter=Ended(), interruptions=lambda: asked[0])


def test_a_trial_that_fails_in_all_retries_is_lost_with_warnings(yaml: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulate = OneSimulator.run

    def run(self: OneSimulator, trial: object) -> object:
        if trial.number == 1:  # type: ignore[attr-defined]
            raise WorkerError("no luck")
        return simulate(self, trial)  # type: ignore[arg-type]

    monkeypatch.setattr(OneSimulator, "run", run)
    reporter = Reporter()
    summary = collect(yaml, "run.retries=1", reporter=reporter)
    assert summary.outcomes == {"landed": 2, "lost": 1}
    assert info(yaml.parent / "data").outcomes["lost"] == 1
    assert reporter.warnings == [f"sim_0: trial 1 {fate}: no luck" for fate in ("is tried again", "is lost")]
    assert runs.find(yaml.parent / "data").record.exit_code == 5


def test_a_run_that_is_prepared_and_not_launched_leaves_no_files(yaml: Path) -> None:
    with runs.prepare(yaml, output=yaml.parent / "data") as run:
        assert (yaml.parent / "data" / "plan.parquet").exists()
        assert Records().ids() == [run.record.run]
    assert not (yaml.parent / "data").exists()
    assert Records().ids() == []
