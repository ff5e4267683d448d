"""The coordinator's process."""

from __future__ import annotations

import gc
import signal
import time
from pathlib import Path
from types import FrameType

from throwcollect import ros
from throwcollect.coordinator.node import Coordinator
from throwcollect.coordinator.replay_check import check_by_replay
from throwcollect.dataset.directory import known_directory
from throwcollect.dataset.inspect import info, loss
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.heartbeat import Heartbeat
from throwcollect.interruption import stop_signals
from throwcollect.ros.self_check import check_answers
from throwcollect.tasks.throw import ThrowResult
from throwcollect.wording import command, counted

_IDLE_S = 0.05
_SYNC_EVERY_S = 1.0
"""What a power cut may cost."""
_TELL_EVERY_S = 10.0
"""For whoever reads the log; the topic has it more often."""


def run(directory: Path) -> None:
    """Collect every trial of the plan in `directory` that has no episode yet, and finish the dataset.

    SIGINT, SIGTERM and SIGHUP drain: running trials are finished and written within `run.grace_s`, none is started.

    Args:
        directory: Directory of the dataset, as `prepare` or `resume` left it.

    Raises:
        DatasetError: If the directory holds no plan, or cannot be written, or a trial came out otherwise when it was
            simulated again.
        WorkerError: If every simulation refuses every trial, trials cannot be simulated again, or ROS 2 is silent.
        LossError: If the dataset is finished, and trials of it are lost.
        Interrupted: If a signal ended the collection before its last trial.
    """
    writer = DatasetWriter.open(directory)
    # All of that before there is a node: a large dataset takes its time, in which nobody would get an answer.
    there: list[tuple[int, ThrowResult]] = []
    if found := writer.recover(lambda trial, result: there.append((trial, result))):
        print(f"keeps {counted(found, 'episode')} of an earlier collection", flush=True)
    ros.init()
    if not ros.joins_protected():
        writer.note("exposed")
    node = Coordinator(writer.plan, writer)
    for trial, result in there:
        node.recall(trial, result)

    def drain(_number: int, _frame: FrameType | None) -> None:
        node.drain()

    for number in stop_signals():
        signal.signal(number, drain)
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    check_answers(node, executor)
    # What is here now stays until the end; the garbage collector need not go through it again and again.
    gc.freeze()
    try:
        _collect(node, writer, executor)
        if not node.complete:
            known = known_directory(directory)
            raise Interrupted(
                f"interrupted; what is finished is in {known or 'the volume'}",
                hint=command("resume", known) if known else None,
            )
        _check(directory, writer, executor)
        writer.finish()
    finally:
        writer.close()
        node.destroy_node()
        ros.shutdown()
    known = known_directory(directory)
    lost = loss(info(directory).outcomes, hint=f"{command('resume', known)} runs them again" if known else None)
    if lost is not None:
        raise lost


def _collect(node: Coordinator, writer: DatasetWriter, executor: ros.Executor) -> None:
    """Have all trials run, or drain.

    Raises:
        WorkerError: If every simulation refuses every trial.
        DatasetError: If the dataset cannot be written.
    """
    told = synced = time.monotonic()
    heartbeat = Heartbeat()
    while not node.finished:
        heartbeat.beat()
        # Simulations come first: what can wait is done when no message is there.
        waiting = node.backlog or node.prepare_one()
        ros.spin_some(executor, timeout_sec=0.0 if waiting else _IDLE_S)
        if node.backlog:
            node.write_one()
        if (reason := node.hopeless) is not None:
            raise WorkerError("every simulation refuses its trials, and none was ever done", evidence=reason)
        now = time.monotonic()
        if now >= synced + _SYNC_EVERY_S:
            synced = now
            writer.sync()
        if now >= told + _TELL_EVERY_S:
            told = now
            print(node.report().line, flush=True)
    print(node.report().line, flush=True)


def _check(directory: Path, writer: DatasetWriter, executor: ros.Executor) -> None:
    """Simulate some trials again; the node answers meanwhile.

    Raises:
        DatasetError: If a trial came out otherwise.
        WorkerError: If trials cannot be simulated again.
    """
    config = writer.plan.config
    heartbeat = Heartbeat()

    def go_on() -> None:
        heartbeat.beat()
        executor.spin_once(timeout_sec=_IDLE_S)

    said = check_by_replay(
        directory,
        writer.digests(),
        count=config.run.replay,
        seed=config.seed,
        meanwhile=go_on,
    )
    if said is not None:
        print(said, flush=True)
