"""Spinning a single node by the executor that the process shares."""

from __future__ import annotations

from throwcollect.ros.embedded.context import get_default_context
from throwcollect.ros.embedded.executors import Executor, SingleThreadedExecutor
from throwcollect.ros.embedded.node import Node
from throwcollect.ros.embedded.task import Future

_shared: list[Executor] = []


def get_global_executor() -> Executor:
    """Executor that is used when none is given; another one after the default context was shut down."""
    if not _shared:
        _shared.append(SingleThreadedExecutor())
        get_default_context().on_shutdown(_forget)
    return _shared[0]


def _forget() -> None:
    _shared.clear()


def spin(node: Node, executor: Executor | None = None) -> None:
    """Call a node's callbacks until the context is shut down.

    Args:
        node: The node.
        executor: Executor; None for the shared one.

    Raises:
        ExternalShutdownException: If the context is shut down meanwhile.
    """
    executor = executor or get_global_executor()
    added = executor.add_node(node)
    try:
        executor.spin()
    finally:
        if added:
            executor.remove_node(node)


def spin_once(node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None) -> None:
    """Call one callback of a node, waiting for it if need be.

    Args:
        node: The node.
        executor: Executor; None for the shared one.
        timeout_sec: Longest time to wait [s]; None or negative for no limit.

    Raises:
        ExternalShutdownException: If the context is not usable.
    """
    executor = executor or get_global_executor()
    added = executor.add_node(node)
    try:
        executor.spin_once(timeout_sec)
    finally:
        if added:
            executor.remove_node(node)


def spin_until_future_complete(
    node: Node, future: Future, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Call a node's callbacks until a future is done or cancelled.

    Args:
        node: The node.
        future: What to wait for.
        executor: Executor; None for the shared one.
        timeout_sec: Longest time [s]; None or negative for no limit.

    Raises:
        ExternalShutdownException: If the context is shut down meanwhile.
    """
    executor = executor or get_global_executor()
    added = executor.add_node(node)
    try:
        executor.spin_until_future_complete(future, timeout_sec)
    finally:
        if added:
            executor.remove_node(node)
