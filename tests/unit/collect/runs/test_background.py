"""Beginning runs in the background; `tests/e2e/test_serve.py` has tests of what their processes do."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from throwcollect.collect.coordinator.reporter import SILENT
from throwcollect.collect.runs import background
from throwcollect.collect.runs.background import begin_run, carry_out
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import Origin
from throwcollect.errors import ConfigError, ConflictError, Interrupted, WorkerError
from throwcollect.state_directory import STATE_VARIABLE

ORIGIN = Origin("throws", 1, {"trials": 2})


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(
        "name: small\ntrials: 2\nsim: {engine: ballistic}\nrun: {runtime: local}\n"
        "sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}\n"
    )
    return path


PROCESS = """
import os, sys, time
os.write(1, sys.stdin.buffer.read())
os.close(1), os.close(2)
time.sleep(60)
"""


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Processes that read an order and then do nothing until they are ended."""
    started: list[subprocess.Popen[bytes]] = []
    begin = subprocess.Popen

    def start(words: list[str], **options: Any) -> subprocess.Popen[bytes]:
        started.append(begin([sys.executable, "-ISc", PROCESS], **{**options, "stdout": subprocess.PIPE}))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    yield started
    for process in started:
        process.kill()
        process.wait()


def end(process: subprocess.Popen[bytes]) -> bytes:
    """End a process and return the order that it has read."""
    assert process.stdout is not None
    with process.stdout as told:
        order = told.read()
    process.kill()
    process.wait()
    return order


def begin(config: Path, tmp_path: Path, **options: Any) -> Any:
    return begin_run(config, overrides=["trials=1"], output=tmp_path / "data", run="a", origin=ORIGIN, **options)


def test_a_run_begun_in_the_background_has_a_record_at_once(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    run = begin(config, tmp_path)
    (process,) = processes
    assert run.status == "running"
    assert (run.record.launcher, run.record.origin, run.record.kind) == (process.pid, ORIGIN, "collection")
    assert run.record.directory == tmp_path / "data"
    assert not (tmp_path / "data").exists()
    order = end(process)
    made_from = background._ORDERS.validate_json(order)
    assert (made_from.config, made_from.overrides, made_from.resumed) == (config, ("trials=1",), False)
    # The lock is released when the process ends, and not before.
    assert Records().get("a").status == "died"


def test_a_second_run_with_the_same_id_is_refused(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    begin(config, tmp_path)
    with pytest.raises(ConflictError, match="there is a run a already"):
        begin(config, tmp_path)
    assert len(processes) == 1
    end(processes[0])


def test_stop_signals_are_blocked_in_a_new_launcher_process(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    begin(config, tmp_path)
    blocked = next(
        int(line.split()[1], 16)
        for line in Path(f"/proc/{processes[0].pid}/status").read_text().splitlines()
        if line.startswith("SigBlk")
    )
    for number in (signal.SIGTERM, signal.SIGINT):
        assert blocked & 1 << (number - 1)
    assert not blocked & 1 << (signal.SIGKILL - 1)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before
    end(processes[0])


def test_a_run_that_cannot_be_begun_leaves_no_record_and_no_process(
    config: Path,
    tmp_path: Path,
    state: Path,
    processes: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(ConfigError, match="trails: unknown key; did you mean 'trials'"):
        begin_run(config, overrides=["trails=1"], output=tmp_path / "data", run="a")
    assert processes == []

    def fail(*_: object) -> None:
        raise ConfigError("the disk is full")

    monkeypatch.setattr(Run, "write", fail)
    with pytest.raises(ConfigError, match="the disk is full"):
        begin(config, tmp_path)
    assert processes[0].poll() is not None
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: (_ for _ in ()).throw(OSError(12, "no memory")))
    with pytest.raises(WorkerError, match=r"run a cannot be begun: .*no memory"):
        begin(config, tmp_path)
    assert list((state / "runs").iterdir()) == []


def take_over(config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]) -> bytes:
    """Begin a run and return its order, so that the test can carry it out instead of the process that was started."""
    begin(config, tmp_path)
    return end(processes[0])


def test_an_error_of_the_preparation_is_written_to_the_record(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    order = take_over(config, tmp_path, processes)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "mine").touch()
    run = Records().take("a")
    assert run is not None
    with pytest.raises(ConfigError) as error:
        carry_out("a", run.lock, order, reporter=SILENT, interruptions=lambda: 0)
    run.close()
    record = Records().get("a").record
    assert (record.exit_code, record.ended is not None) == (2, True)
    assert str(record.error) == str(error.value)
    assert str(tmp_path / "data") in str(record.error)
    assert record.origin == ORIGIN


def test_a_run_can_be_interrupted_during_its_preparation(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]]
) -> None:
    order = take_over(config, tmp_path, processes)
    run = Records().take("a")
    assert run is not None
    with pytest.raises(Interrupted):
        carry_out("a", run.lock, order, reporter=SILENT, interruptions=lambda: 1)
    run.close()
    record = Records().get("a").record
    assert (record.exit_code, str(record.error)) == (130, "stopped before any node was started")
    assert (record.origin, record.kind) == (ORIGIN, "collection")


def test_a_run_that_fails_between_preparation_and_launch_leaves_no_dataset(
    config: Path, tmp_path: Path, processes: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    order = take_over(config, tmp_path, processes)
    run = Records().take("a")
    assert run is not None

    def fail(_before: Path, _after: Path) -> None:
        assert (tmp_path / "data" / "plan.parquet").exists()
        raise WorkerError("no space left")

    monkeypatch.setattr(background, "_move_log", fail)
    with pytest.raises(WorkerError):
        carry_out("a", run.lock, order, reporter=SILENT, interruptions=lambda: 0)
    assert not (tmp_path / "data").exists()
    assert str(Records().get("a").record.error) == "no space left"
    assert Records().get("a").status == "ended"
