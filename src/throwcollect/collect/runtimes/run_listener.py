"""Takes part in the ROS graph of a run, and receives its progress reports, for its launcher and all who follow it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from throwcollect import ros
from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator_node.preview import PROGRESS_QOS, PROGRESS_TOPIC
from throwcollect.errors import ConfigError, ThrowcollectError, UnreachableError
from throwcollect.ros.connection import Connection
from throwcollect.ros.graph_names import make_own_name
from throwcollect.ros.msg import String
from throwcollect.ros.router_endpoint import answers

_SILENT_S = 8.0
"""Reports come several times a second; after this silence the connection may be broken, so it is made anew."""


@contextmanager
def take_part(connection: Connection, name: str | None = None) -> Iterator[tuple[ros.Node, ros.Executor]]:
    """Take part in the ROS graph of a run with a node and the executor that it spins in, in a context of their own.

    By default, the node has a unique and hidden name.
    """
    context = ros.Context()
    ros.init(context=context, connection=connection)
    with ExitStack() as undo:
        undo.callback(ros.shutdown, context=context)
        node = ros.Node(name or make_own_name(), context=context)
        undo.callback(node.destroy_node)
        executor = ros.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        yield node, executor


def call_nodes(
    connection: Connection, nodes: Sequence[str], service: type, name: str, request: Any, *, patience_s: float
) -> list[Any]:
    """Call a service of several nodes of a run at the same time, and return their responses.

    Args:
        connection: The way into the run.
        nodes: Full names of the nodes.
        service: Type of the service.
        name: Its name below that of a node.
        request: The request.
        patience_s: Longest wait for the router, and then for the nodes [s].
    """
    if not answers(connection.endpoint, patience_s=patience_s):
        raise UnreachableError(f"no router answers at {connection.endpoint}")
    with take_part(connection) as (asking, executor):
        deadline = time.monotonic() + patience_s
        futures = []
        for node in nodes:
            client = asking.create_client(service, f"{node}/{name}")
            # A request that is sent before the service is found is lost.
            if not client.wait_for_service(max(0.0, deadline - time.monotonic())):
                raise UnreachableError(f"{node} cannot be found over the router at {connection.endpoint}")
            futures.append(client.call_async(request))
        for node, future in zip(nodes, futures, strict=True):
            executor.spin_until_future_complete(future, timeout_sec=max(0.0, deadline - time.monotonic()))
            if not future.done():
                raise UnreachableError(f"{node} does not answer over the router at {connection.endpoint}")
        return [future.result() for future in futures]


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
        self._executor: ros.Executor | None = None
        self._leave = ExitStack()
        self._connection: Connection | None = None
        self._heard_at = 0.0

    def __enter__(self) -> RunListener:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor = None
        self._leave.close()

    def spin(self, connection: Connection | None, seconds: float) -> None:
        """Wait for a report, or for the router, for at most this number of seconds.

        `connection` is the present way into the run; None while its router has no address.
        """
        elsewhere = connection != self._connection or time.monotonic() > self._heard_at + self._silent_s
        if connection is not None and elsewhere and answers(connection.endpoint):
            self.__exit__(None, None, None)
            self._connect(connection)
        if self._executor is not None:
            self._executor.spin_once(timeout_sec=seconds)
        else:
            time.sleep(seconds)

    def _connect(self, connection: Connection) -> None:
        self._heard_at = time.monotonic()
        try:
            node, self._executor = self._leave.enter_context(take_part(connection, self._name))
        # A `ConfigError` is a `ThrowcollectError`, too, but another attempt would fail in the same way.
        except ConfigError:
            raise
        except ThrowcollectError:
            # The router answered a moment ago, so it has just ended; the next attempt finds the next router.
            return
        self._connection = connection
        node.create_subscription(String, PROGRESS_TOPIC, self._hear, PROGRESS_QOS)
        self._on_connect(node)

    def _hear(self, message: String) -> None:
        if (progress := Progress.read(message.data)) is not None:
            self._heard_at = time.monotonic()
            self._on_progress(progress)
