"""What `logs` prints of datasets that were submitted to a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from throwcollect.cli import cluster_runs
from throwcollect.collect.cluster.cluster_run import SlicesState
from throwcollect.collect.cluster.slurm import ArrayTask


def look(*tasks: ArrayTask, complete: bool = False) -> SlicesState:
    return SlicesState(frozenset(), tasks, None, complete)


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
