"""A prepared run can be launched only once, and stopped wherever it was launched."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from throwcollect import runs
from throwcollect.collect.runs.run import Run
from throwcollect.errors import Interrupted
from throwcollect.state_directory import STATE_VARIABLE

YAML = """\
trials: 1
sim: {engine: ballistic}
run: {runtime: inprocess, replay: 0}
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}
"""


@pytest.fixture
def prepared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))
    (tmp_path / "small.yaml").write_text(YAML)
    return runs.prepare(tmp_path / "small.yaml", output=tmp_path / "data")


def call_later(act: Callable[[], object]) -> Callable[[], int]:
    """Count no interruptions, but call `act` in another thread, once the run collects."""
    thread = threading.Thread(target=act)

    def interruptions() -> int:
        if thread.ident is None:
            thread.start()
        # The run must not end before the other thread acts.
        time.sleep(0.02)
        return 0

    return interruptions


@pytest.fixture
def many(prepared: Run, tmp_path: Path) -> Run:
    """A run that lasts until somebody stops it."""
    return runs.prepare(tmp_path / "small.yaml", output=tmp_path / "many", overrides=["trials=300"])


def test_stopping_a_run_that_a_program_collects_drains_it_and_leaves_the_program_alive(
    many: Run, tmp_path: Path
) -> None:
    def stop() -> None:
        stopped.append(runs.stop(runs.find(tmp_path / "many")))

    stopped: list[runs.Run] = []
    with many as run, pytest.raises(Interrupted, match="interrupted"):
        run.collect(interruptions=call_later(stop))
    deadline = time.monotonic() + 30
    while not stopped and time.monotonic() < deadline:
        time.sleep(0.01)
    assert stopped[0].record.exit_code == Interrupted.exit_code
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_run_that_ctrl_c_ends_in_a_program_was_interrupted(many: Run, tmp_path: Path) -> None:
    with many as run, pytest.raises(KeyboardInterrupt):
        run.collect(interruptions=call_later(lambda: signal.raise_signal(signal.SIGINT)))
    record = runs.find(tmp_path / "many").record
    assert (record.exit_code, record.failure and record.failure.message) == (Interrupted.exit_code, "interrupted")


def test_a_run_in_another_thread_handles_no_signals(prepared: Run) -> None:
    with prepared as run:
        thread = threading.Thread(target=run.collect)
        thread.start()
        thread.join()
    assert runs.wait(runs.find(run.id)).outcomes
