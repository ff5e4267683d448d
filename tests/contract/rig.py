"""Nodes on the backend of this process, and names of rclpy that lie in different modules on the two backends."""

from __future__ import annotations

import gc
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

from throwcollect.ros import Context, Future, Node, SingleThreadedExecutor
from throwcollect.ros.middleware import Middleware, uses_rclpy

ON_RCLPY = uses_rclpy()
ON_DDS = Middleware.of_process().is_fast_dds
PATIENCE_S = 30.0
"""Genuine nodes discover each other and their endpoints within a second, but the machine may be very busy."""

SERVER = """
from throwcollect import ros

ros.init()
node = ros.Node("server")

def answer(request, response):
    response.success = True
    return response

node.create_service(ros.get_service("std_srvs/srv/Trigger"), "trigger", answer)
executor = ros.SingleThreadedExecutor()
executor.add_node(node)
print("ready", flush=True)
executor.spin()
"""
"""A node with the service ``trigger``, which leaves its context to the end of the process."""

if ON_RCLPY:
    from rclpy import exceptions as exceptions
    from rclpy.exceptions import InvalidHandle as InvalidHandle
    from rclpy.exceptions import NotInitializedException as NotInitializedException
    from rclpy.logging import get_logger as get_logger
    from rclpy.utilities import get_default_context as get_default_context
else:
    from rclzenoh import exceptions as exceptions
    from rclzenoh.context import get_default_context as get_default_context
    from rclzenoh.exceptions import InvalidHandle as InvalidHandle
    from rclzenoh.exceptions import NotInitializedException as NotInitializedException
    from rclzenoh.logging import Logger

    get_logger = Logger


def choose_words(*, embedded: str, rclpy: str) -> str:
    """Choose the regular expression for a message: both backends raise the same class of error, with other words."""
    return rclpy if ON_RCLPY else embedded


def names_of(node: Node) -> list[str]:
    """Names of the nodes that a node sees, sorted."""
    return sorted(name for name, _ in node.get_node_names_and_namespaces())


def start_python(*arguments: str, **options: Any) -> subprocess.Popen[str]:
    """Start a process of Python whose output is text."""
    return subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True, **options)


class Rig:
    """Nodes, each in a session of its own unless told otherwise, and a way to spin them all."""

    def __init__(self) -> None:
        self.contexts: list[Context] = []
        self.executors: list[tuple[SingleThreadedExecutor, Node]] = []

    def context(self) -> Context:
        context = Context()
        context.init()
        self.contexts.append(context)
        return context

    def node(self, name: str, *, context: Context | None = None, **options: Any) -> Node:
        node = Node(name, context=context or self.context(), **options)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        self.executors.append((executor, node))
        return node

    def spin(self, until: Callable[[], Any], timeout: float = PATIENCE_S) -> bool:
        """Spin until a condition is true; returns whether it became so."""
        deadline = time.monotonic() + timeout
        while not until():
            if time.monotonic() > deadline:
                return False
            for executor, _ in self.executors:
                executor.spin_once(timeout_sec=0.001)
        return True

    def sees(self, condition: Callable[[], Any]) -> bool:
        """Whether a condition becomes true: news of other nodes takes a while, by router or by discovery."""
        return self.spin(condition)

    def result(self, future: Future, timeout: float = PATIENCE_S) -> Any:
        assert self.spin(future.done, timeout), "no result"
        return future.result()

    def rest(self, seconds: float = 0.1) -> None:
        """Spin for a while, so that an event that should not happen has time to happen."""
        self.spin(lambda: False, seconds)

    def close(self) -> None:
        self._close_nodes()
        for context in self.contexts:
            context.try_shutdown()
        if ON_DDS:
            # An action refers to itself, so its node would stay in its domain, where a later test would see it.
            gc.collect()

    def _close_nodes(self) -> None:
        # Without a timeout, an executor of rclpy would wait for tasks.
        options: Any = {"timeout_sec": 0} if ON_RCLPY else {}
        for executor, node in self.executors:
            executor.shutdown(**options)
            node.destroy_node()
        self.executors.clear()
