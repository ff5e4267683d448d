"""The topic on which the coordinator tells its progress: a std_msgs/String of JSON, for whoever comes, however late."""

from __future__ import annotations

import os
from collections.abc import Callable
from types import TracebackType
from typing import Any

from throwcollect import ros
from throwcollect.coordinator.progress import Progress
from throwcollect.ros import DurabilityPolicy, get_message

String: Any = get_message("std_msgs/msg/String")

PROGRESS_TOPIC = "/coordinator/progress"
PROGRESS_QOS = ros.QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ProgressListener:
    """A node of its own that hears the coordinator's progress; use it as a context manager.

    Attributes:
        node: The node.

    Args:
        on_progress: Called with every report, within `spin`.
        name: Name of the node; one of this process alone, and hidden, by default.

    Raises:
        ThrowcollectError: If there is no router.
    """

    def __init__(self, on_progress: Callable[[Progress], None], *, name: str | None = None) -> None:
        ros.init()
        self.node = ros.Node(name or f"_throwcollect_{os.getpid()}")
        self._executor = ros.SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._on_progress = on_progress
        self.node.create_subscription(String, PROGRESS_TOPIC, self._hear, PROGRESS_QOS)

    def __enter__(self) -> ProgressListener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.node.destroy_node()
        ros.shutdown()

    def spin(self, seconds: float) -> None:
        """Wait for a report, at most so long [s]."""
        self._executor.spin_once(timeout_sec=seconds)

    def _hear(self, message: Any) -> None:
        if (progress := Progress.read(message.data)) is not None:
            self._on_progress(progress)
