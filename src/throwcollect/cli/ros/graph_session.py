"""How a command of `throwcollect ros` joins the ROS graph, waits for answers and leaves."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from throwcollect import ros
from throwcollect.errors import ConfigError, Interrupted, UnreachableError, WorkerError
from throwcollect.ros.graph_names import make_own_name
from throwcollect.wording import suggest

if TYPE_CHECKING:
    from throwcollect.collect.runs.run import Run
    from throwcollect.ros.connection import Connection

_WAIT_S = 0.2
"""Longest single wait: rclpy handles signals only between two waits."""
_QUIET_S = 0.5
"""Time without anything new after which discovery counts as complete."""
_LOOKING_S = 3.0
"""Longest time for discovery: nodes on DDS find each other within a second, and the machine may be busy."""


class GraphSession:
    """A hidden node, and the executor that it spins in."""

    def __init__(self) -> None:
        self.node = ros.Node(make_own_name(), enable_rosout=False, start_parameter_services=False)
        self._executor = ros.SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def spin_until(self, done: Callable[[], bool]) -> None:
        """Run callbacks until a condition holds."""
        while not done():
            self._executor.spin_once(timeout_sec=_WAIT_S)

    def wait_for_discovery(self) -> None:
        """Wait until other nodes are discovered, and nothing new follows for a moment.

        DDS reports each node and topic as it finds it, and never that it has found all of them.
        """
        known: set[object] = set()
        start = changed = time.monotonic()
        while (now := time.monotonic()) < start + _LOOKING_S:
            self._executor.spin_once(timeout_sec=_WAIT_S)
            nodes = set(self.node.get_node_names_and_namespaces())
            discovered: set[object] = {*nodes, *(name for name, _ in self.node.get_topic_names_and_types())}
            if discovered != known:
                known, changed = discovered, now
            # This node is always among them, so a single node means that no other was found yet.
            elif len(nodes) > 1 and now > changed + _QUIET_S:
                return

    def answer(self, future: ros.Future, *, alive: Callable[[], bool], who: str) -> Any:
        """Wait for the answer to a request to a node or service; `alive` is whether that one still exists."""
        self.spin_until(lambda: future.done() or not alive())
        if not future.done():
            raise WorkerError(f"{who} is gone and has not answered")
        return future.result()


def find_run_and_connection(run: str | None) -> tuple[Run, Connection]:
    """Find a run, or the only one that lives, and the connection by which our own processes join it."""
    # This loads Zenoh, and every command of throwcollect loads this module.
    from throwcollect.collect.runs.run_selection import find_run_to_change, require_living

    found = find_run_to_change(run)
    require_living(found)
    if (connection := found.connection) is None:
        raise WorkerError(f"run {found.id} has no router yet", hint="try once more")
    return found, replace(connection, middleware=connection.middleware.joining)


def _settle_middleware(run: str | None) -> str | None:
    """Make this process use the middleware of the run; without a run, the environment decides.

    This has to happen before the process takes any name from `throwcollect.ros`.
    """
    if run is not None:
        find_run_and_connection(run)[1].middleware.settle()
    return run


RunOption = Annotated[
    str | None,
    typer.Option(
        "--run",
        metavar="RUN",
        callback=_settle_middleware,
        help="Join this run: its id, the beginning of that, or the dataset's directory. By default, the router that "
        "ZENOH_CONFIG_OVERRIDE names, or the one at tcp/localhost:7447.",
    ),
]


@contextmanager
def join_graph(run: str | None) -> Iterator[GraphSession]:
    """Join the graph of a run, or without a run, the graph of the router that the environment names."""
    from throwcollect.ros.middleware import Middleware

    connection = None if run is None else find_run_and_connection(run)[1]
    try:
        try:
            ros.init(connection=connection)
        except UnreachableError as error:
            raise ConfigError(
                error.message,
                expected="a router there, or another one named in ZENOH_CONFIG_OVERRIDE",
                hint="--run RUN joins a run; throwcollect ps lists them",
            ) from error
        session = GraphSession()
        try:
            if Middleware.of_process().is_fast_dds:
                session.wait_for_discovery()
            yield session
        finally:
            session.node.destroy_node()
            ros.shutdown()
    except KeyboardInterrupt:
        raise Interrupted("") from None


def require_name(what: str, name: str, names: Iterable[str]) -> None:
    """Refuse the name of a thing, such as a ``topic``, that the graph does not have, and propose similar names."""
    existing = sorted(set(names))
    if name not in existing:
        raise ConfigError(f"no {what} {name}{suggest(name, existing)}")
