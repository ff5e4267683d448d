"""What `events`, `ps` and `logs` print of datasets that were submitted to a cluster."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from throwcollect.cli import cluster_runs
from throwcollect.cluster.cluster_run import SlicesState
from throwcollect.cluster.slurm import ArrayTask
from throwcollect.errors import ConfigError

RUN: Any = SimpleNamespace()


def look(*tasks: ArrayTask, complete: bool = False) -> SlicesState:
    return SlicesState(frozenset(), tasks, None, complete)


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = [look(ArrayTask(0, "RUNNING", "n1", "")), look(ArrayTask(0, "COMPLETED", "n1", "0:0"), complete=True)]
    monkeypatch.setattr(cluster_runs, "follow", lambda _run, **_: iter(seen))


@pytest.mark.usefixtures("looks")
def test_events_of_a_cluster_run_with_json_are_one_document_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    cluster_runs.print_events(RUN, as_json=True)
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [
        {"event": "task", "task": 0, "state": "running on n1"},
        {"event": "task", "task": 0, "state": "completed on n1"},
        {"event": "finished"},
    ]


def test_a_run_is_named_by_its_joining_job_if_nothing_else_was_submitted(monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = [SimpleNamespace(array="7", join="8"), SimpleNamespace(array="", join="9")]
    run: Any = SimpleNamespace(submission=SimpleNamespace(jobs=jobs, tasks=3), directory="data")
    assert cluster_runs.make_document(run, look())["run"] == "9"


@pytest.mark.parametrize("named", ["2", "-1", "²", "sim_0"])
def test_logs_of_a_task_that_does_not_exist_are_refused(named: str) -> None:
    run: Any = SimpleNamespace(directory="data", logs={}, submission=SimpleNamespace(tasks=2))
    with pytest.raises(ConfigError, match=f"data: has no task '{named}'"):
        cluster_runs.print_logs(run, [named])


def test_logs_of_a_cluster_run_are_followed_until_it_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    logs: dict[str, Path] = {}
    run: Any = SimpleNamespace(directory="data", logs=logs, submission=SimpleNamespace(tasks=2))
    first, second = tmp_path / "7_0.log", tmp_path / "7_1.log"

    def follow(_run: Any, **_: Any) -> Iterator[SlicesState]:
        yield look()
        logs["0"] = first
        first.write_text("begins\nhal")
        yield look()
        logs["1"] = second
        first.write_text("begins\nhalf\n")
        second.write_text("ends")
        yield look()

    monkeypatch.setattr(cluster_runs, "follow", follow)
    cluster_runs.print_logs(run, [], until_end=True)
    assert capsys.readouterr().out.splitlines() == ["0 | begins", "0 | half", "1 | ends"]
    # A task that has not begun yet may be named; its log is printed once it has one.
    logs.clear()
    cluster_runs.print_logs(run, ["1"], until_end=True)
    assert capsys.readouterr().out.splitlines() == ["1 | ends"]


def test_a_submission_that_is_gone_does_not_hide_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = SimpleNamespace(look=look)

    def open_run(directory: Path) -> SimpleNamespace:
        if directory == tmp_path / "gone":
            raise ConfigError(f"{directory}: no submission")
        return there

    monkeypatch.setattr(cluster_runs, "ClusterRun", SimpleNamespace(open=open_run))
    assert [run for run, _ in cluster_runs.list_queued([tmp_path / "gone", tmp_path])] == [there]
    assert "gone: no submission" in capsys.readouterr().err
