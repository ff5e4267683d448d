"""The coordinator's process."""

from __future__ import annotations

import gc
import signal
import time
from pathlib import Path
from types import FrameType

from throwcollect import ros
from throwcollect.coordinator.node import Coordinator
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import Interrupted

_IDLE_S = 0.05
_TELL_EVERY_S = 10.0
"""For whoever reads the log; the topic has it more often."""


def run(directory: Path) -> None:
    """Collect every trial of the plan in `directory`, and finish the dataset.

    SIGINT and SIGTERM drain: running trials are finished and written, no new one is started.

    Args:
        directory: Directory of the dataset, as `prepare` left it.

    Raises:
        DatasetError: If the directory holds no plan, or cannot be written.
        Interrupted: If a signal ended the collection before its last trial.
    """
    writer = DatasetWriter.open(directory)
    ros.init()
    node = Coordinator(writer.plan, writer)

    def drain(_number: int, _frame: FrameType | None) -> None:
        node.drain()

    signal.signal(signal.SIGINT, drain)
    signal.signal(signal.SIGTERM, drain)
    executor = ros.SingleThreadedExecutor()
    executor.add_node(node)
    # What is here now stays until the end; the garbage collector need not go through it again and again.
    gc.freeze()
    started = told = time.monotonic()
    try:
        while not node.finished:
            # Simulations come first: what can wait is done when no message is there.
            waiting = node.backlog or node.prepare_one()
            executor.spin_once(timeout_sec=0.0 if waiting else _IDLE_S)
            if node.backlog:
                node.write_one()
            if time.monotonic() >= told + _TELL_EVERY_S:
                told = time.monotonic()
                print(node.report().line, flush=True)
        print(node.report().line, flush=True)
        if not node.complete:
            raise Interrupted(f"interrupted; what is finished is in {directory}")
        writer.finish(wall_s=time.monotonic() - started)
    finally:
        writer.close()
        node.destroy_node()
        ros.shutdown()
