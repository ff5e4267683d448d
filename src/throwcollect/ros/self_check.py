"""Begins to serve with nodes: handles signals, and checks that the nodes can be reached before they say so."""

from __future__ import annotations

import gc
import signal
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

from throwcollect import ros
from throwcollect.errors import WorkerError
from throwcollect.interruption import stop_signals
from throwcollect.ros.middleware import Middleware

_ANSWER_S = 10.0
_AGAIN_S = 1.0
_LOOK_S = 0.05


def begin_to_serve(*nodes: ros.Node) -> tuple[ros.Executor, Callable[[], int]]:
    """Put nodes into an executor, which the caller then spins until a signal asks this process to stop.

    Returns:
        The executor, and a function that tells the number of the last signal that asked to stop; 0 if none has.
    """
    executor = ros.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    stopped = 0

    def stop(number: int, _frame: FrameType | None) -> None:
        # Only the loop of the caller acts on it, because a signal may come in the middle of anything.
        nonlocal stopped
        stopped = number
        # That loop may be waiting for messages, and would see `stopped` only after that.
        ros.stop_waiting(executor)

    for number in stop_signals():
        signal.signal(number, stop)
    check_answers(nodes[0], executor)
    # The objects made so far stay until the end, so the garbage collector need not go through them again and again.
    gc.freeze()
    return executor, lambda: stopped


def check_answers(node: ros.Node, executor: ros.Executor) -> None:
    """Let a node call one of its own services, while its executor spins as it will in this process.

    Without this check, a backend that does not answer would show only as a collection that does not begin.
    """
    service: Any = ros.get_service("rcl_interfaces/srv/GetParameters")
    client = node.create_client(service, f"{node.get_fully_qualified_name()}/get_parameters")
    deadline = time.monotonic() + _ANSWER_S
    answers: list[ros.Future] = []
    asked_at = 0.0
    try:
        while not any(answer.done() for answer in answers):
            now = time.monotonic()
            if now > deadline:
                middleware = Middleware.of_process()
                backend = "the embedded backend" if middleware.backend == "embedded" else f"rclpy with {middleware.rmw}"
                raise WorkerError(
                    f"{node.get_fully_qualified_name()} does not answer itself within {_ANSWER_S:g} s, over {backend}",
                    hint="throwcollect doctor shows what is installed; --set run.ros=embedded needs none of it",
                )
            # A request that is sent before client and service have found each other is lost, so it is repeated.
            if now >= asked_at + _AGAIN_S:
                asked_at = now
                answers.append(client.call_async(service.Request()))
            ros.spin_some(executor, timeout_sec=_LOOK_S)
    finally:
        node.destroy_client(client)
