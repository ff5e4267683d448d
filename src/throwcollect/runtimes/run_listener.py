"""Receives the progress reports of a run, for its launcher and for everybody who follows the run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from throwcollect import ros
from throwcollect.coordinator.progress import Progress
from throwcollect.coordinator.shown_topics import PROGRESS_QOS, PROGRESS_TOPIC
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.ros.connection import Connection
from throwcollect.ros.graph_names import make_own_name
from throwcollect.ros.msg import String
from throwcollect.ros.router_endpoint import answers

_SILENT_S = 8.0
"""Reports come several times a second; after this silence the connection may be broken, so it is made anew."""


class RunListener:
    """A node that receives the coordinator's reports, and reconnects when the router gets another address.

    Use it as a context manager. It has a ROS context of its own, so that a process may listen to several runs.

    Args:
        on_progress: Is called with every report, within `spin`.
        name: Name of the node; by default a unique and hidden one.
        reports: Whether the run has a coordinator, which reports.
        on_connect: Is called with the node whenever the node is made, which happens at each reconnection.
    """

    def __init__(
        self,
        on_progress: Callable[[Progress], None],
        *,
        name: str | None = None,
        reports: bool = True,
        on_connect: Callable[[ros.Node], None] = lambda _: None,
    ) -> None:
        self._on_progress = on_progress
        self._name = name or make_own_name()
        self._silent_s = _SILENT_S if reports else math.inf
        self._on_connect = on_connect
        self._node: ros.Node | None = None
        self._connection: Connection | None = None
        self._heard_at = 0.0

    def __enter__(self) -> RunListener:
        return self

    def __exit__(self, *_: object) -> None:
        if self._node is not None:
            self._node.destroy_node()
            ros.shutdown(context=self._context)
            self._node = None

    def spin(self, connection: Connection | None, seconds: float) -> None:
        """Wait for a report, or for the router, for at most this number of seconds.

        `connection` is the present way into the run; None while its router has no address.

        Raises:
            ConfigError: If the key of the run cannot be read.
        """
        elsewhere = connection != self._connection or time.monotonic() > self._heard_at + self._silent_s
        if connection is not None and elsewhere and answers(connection.endpoint):
            self.__exit__(None, None, None)
            self._connect(connection)
        if self._node is not None:
            self._executor.spin_once(timeout_sec=seconds)
        else:
            time.sleep(seconds)

    def _connect(self, connection: Connection) -> None:
        self._heard_at = time.monotonic()
        self._context = ros.Context()
        try:
            ros.init(context=self._context, connection=connection)
        # A `ConfigError` is a `ThrowcollectError`, too, but another attempt would fail in the same way.
        except ConfigError:
            raise
        except ThrowcollectError:
            # The router answered a moment ago, so it has just ended; the next attempt finds the next router.
            return
        self._node, self._connection = ros.Node(self._name, context=self._context), connection
        self._executor = ros.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(String, PROGRESS_TOPIC, self._hear, PROGRESS_QOS)
        self._on_connect(self._node)

    def _hear(self, message: String) -> None:
        if (progress := Progress.read(message.data)) is not None:
            self._heard_at = time.monotonic()
            self._on_progress(progress)
