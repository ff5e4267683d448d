"""The coordinator's process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from throwcollect import ros
from throwcollect.coordinator.collection import TrialCollection
from throwcollect.errors import WorkerError
from throwcollect.heartbeat import Heartbeat
from throwcollect.ros.nodes.coordinator.node import Coordinator
from throwcollect.ros.self_check import begin_to_serve
from throwcollect.side_by_side import count_cores

_IDLE_S = 0.05
_TELL_EVERY_S = 10.0
"""Real time between two lines of progress in the log; it is published on its topic more often."""


def run(directory: Path, *, patience_s: float = math.inf) -> None:
    """Collect all trials of a dataset's plan that have no episode yet, and finish the dataset.

    SIGINT, SIGTERM and SIGHUP drain: running trials are finished and written within `run.grace_s`, none is started.

    Args:
        directory: Its directory.
        patience_s: How long to go on while no simulation is there [s]. A launcher looks after its simulations itself.
    """
    # The dataset is opened before the node exists, because opening a large one takes long and a node has to answer.
    with TrialCollection.open(directory, say=_say, processes=count_cores()) as collection:
        ros.init()
        # Note in the journal that anybody could join this run, because the finished dataset has to say so.
        if not ros.joins_protected():
            collection.writer.note("exposed")
        node = Coordinator(collection)
        executor, stopped = begin_to_serve(node)
        heartbeat = Heartbeat()

        def keep_answering() -> None:
            """Answer other nodes while trials are simulated again."""
            heartbeat.beat()
            executor.spin_once(timeout_sec=_IDLE_S)

        try:
            _collect(node, collection, executor, heartbeat, stopped, patience_s=patience_s)
            collection.finish(meanwhile=keep_answering, say=_say)
        finally:
            node.destroy_node()
            ros.shutdown()


def _collect(
    node: Coordinator,
    collection: TrialCollection,
    executor: ros.Executor,
    heartbeat: Heartbeat,
    stopped: Callable[[], int],
    *,
    patience_s: float,
) -> None:
    """Collect until all trials have ended or, after a signal that asks to stop, those that run."""
    told = seen = time.monotonic()
    while not collection.finished:
        heartbeat.beat()
        if stopped():
            collection.drain()
        # Messages of simulations come first; other work is done when there is none.
        waiting = collection.backlog or collection.check_next()
        ros.spin_some(executor, timeout_sec=0.0 if waiting else _IDLE_S)
        if collection.backlog:
            collection.write_one()
        collection.look_after()
        if node.sees_simulations:
            seen = time.monotonic()
        elif time.monotonic() > seen + patience_s:
            raise WorkerError(
                f"no simulation was there for {patience_s:g} s (run.start_timeout_s)",
                hint="what the simulations print says why",
            )
        if time.monotonic() >= told + _TELL_EVERY_S:
            told = time.monotonic()
            _say(node.report().line)
    _say(node.report().line)


def _say(line: str) -> None:
    print(line, flush=True)
