"""A moment in the ROS graph: how `throwcollect ros` joins it, waits in it and leaves it."""

from __future__ import annotations

import difflib
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from throwcollect import ros
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError, WorkerError
from throwcollect.ros.names import is_hidden, make_own_name

if TYPE_CHECKING:
    from throwcollect.ros.connection import Connection

_SLICE_S = 0.2
"""rclpy looks at signals between two waits only."""
_QUIET_S = 0.5
_LOOKING_S = 3.0
"""Nodes on DDS find each other within a second; the machine may be busy."""
_MOST_NAMES = 8


class Session:
    """A hidden node, and the executor that it spins in.

    Attributes:
        node: The node.
    """

    def __init__(self) -> None:
        self.node = ros.Node(make_own_name(), enable_rosout=False, start_parameter_services=False)
        self._executor = ros.SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def spin_until(self, done: Callable[[], bool]) -> None:
        """Call back until something is true."""
        while not done():
            self._executor.spin_once(timeout_sec=_SLICE_S)

    def look_around(self) -> None:
        """Wait until others are seen and nothing new comes: DDS tells of one thing after another, not of the last."""
        seen: set[object] = set()
        start = changed = time.monotonic()
        while (now := time.monotonic()) < start + _LOOKING_S:
            self._executor.spin_once(timeout_sec=_SLICE_S)
            nodes = set(self.node.get_node_names_and_namespaces())
            sees: set[object] = {*nodes, *(name for name, _ in self.node.get_topic_names_and_types())}
            if sees != seen:
                seen, changed = sees, now
            elif len(nodes) > 1 and now > changed + _QUIET_S:
                return

    def answer(self, future: ros.Future, *, alive: Callable[[], bool], who: str) -> Any:
        """Wait for an answer.

        Args:
            future: What is waited for.
            alive: Whether somebody is there who may answer.
            who: Who that is.

        Returns:
            The answer.

        Raises:
            WorkerError: If nobody is there any more.
        """
        self.spin_until(lambda: future.done() or not alive())
        if not future.done():
            raise WorkerError(f"{who} is gone and has not answered")
        return future.result()

    def node_names(self) -> list[str]:
        """Absolute names of all nodes but our own, sorted."""
        found = self.node.get_node_names_and_namespaces()
        own = self.node.get_name()
        return sorted(f"{namespace.removesuffix('/')}/{name}" for name, namespace in found if name != own)

    def close(self) -> None:
        """Leave."""
        self.node.destroy_node()
        ros.shutdown()


@contextmanager
def join_graph(run: str | None) -> Iterator[Session]:
    """Join the graph of a run, or of the router that the environment names.

    Args:
        run: Id of a run, unique beginning of one, or directory of the dataset; None for the environment's router.

    Yields:
        The session.

    Raises:
        ConfigError: If there is no such run or no router.
        WorkerError: If the run has no router (any more).
        Interrupted: If the user leaves; the message is empty, as that is how one leaves.
    """
    # Here, as every command of throwcollect loads this module, and those load Zenoh.
    from throwcollect.ros.middleware import Middleware

    try:
        _init(None if run is None else _connection(run))
        session = Session()
        try:
            if Middleware.of_process().is_fast_dds:
                session.look_around()
            yield session
        finally:
            session.close()
    except KeyboardInterrupt:
        raise Interrupted("") from None


def _connection(run: str) -> Connection:
    from throwcollect.cli.ros.env import find_way

    return find_way(run).connection


def _init(connection: Connection | None) -> None:
    try:
        ros.init(connection=connection)
    except ConfigError:
        raise
    except ThrowcollectError as error:
        raise ConfigError(
            error.message,
            expected="a router there, or another one named in ZENOH_CONFIG_OVERRIDE",
            hint="--run RUN joins a run; throwcollect ps lists them",
        ) from error


def require_name(what: str, name: str, names: Iterable[str], *, of: str = "") -> None:
    """Refuse a name that is not there.

    Args:
        what: What it names, such as ``topic``.
        name: The name.
        names: All names that there are.
        of: Whose it would be; empty for the graph's.

    Raises:
        ConfigError: If it is none of them.
    """
    there = sorted(set(names))
    if name in there:
        return
    near = difflib.get_close_matches(name, there, n=3) or [each for each in there if not is_hidden(each)]
    listed = ", ".join(near[:_MOST_NAMES]) + (", ..." if len(near) > _MOST_NAMES else "")
    owner = f" of {of}" if of else ""
    raise ConfigError(f"no {what} {name}{owner}" + ("" if there else "; there is none"), expected=listed or None)


def print_names(names_and_types: Iterable[tuple[str, list[str]]], *, types: bool, hidden: bool) -> None:
    """Print names, one a line, with their types if wanted, without hidden ones if wanted."""
    for name, kinds in names_and_types:
        if hidden or not is_hidden(name):
            print(f"{name} [{', '.join(kinds)}]" if types else name)
