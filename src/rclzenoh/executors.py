"""Executors: they call the callbacks of nodes, one at a time, in the thread that spins."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from functools import partial
from queue import Empty
from typing import Any

from rclzenoh.context import Context, get_default_context
from rclzenoh.exceptions import ExternalShutdownException
from rclzenoh.mailbox import Mailbox
from rclzenoh.node_base import NodeBase
from rclzenoh.task import Future, Task, call, submit
from rclzenoh.time import S_TO_NS, Timer, deadline_after

_LONGEST_WAIT_S = 0.5
"""Waits are limited: if a signal comes just before a wait, Python runs its handler only when the wait ends."""


class Executor:
    """Calls the callbacks of its nodes in order of arrival; timers take turns with everything else."""

    def __init__(self, *, context: Context | None = None) -> None:
        self.context = context or get_default_context()
        self._mailbox = Mailbox()
        self._queue = self._mailbox.queue
        self._nodes: list[NodeBase] = []
        self._is_shutdown = False
        self._timer_was_last = False
        self.context.executors.add(self)

    def add_node(self, node: NodeBase) -> bool:
        """Take care of a node's callbacks; returns True."""
        if node.executor is not None:
            node.executor.remove_node(node)
        self._nodes.append(node)
        node.executor = self
        node.mailbox.attach(self._queue)
        self.wake()
        return True

    def remove_node(self, node: NodeBase) -> None:
        """Stop taking care of a node's callbacks, but for those of what has arrived."""
        if node in self._nodes:
            self._nodes.remove(node)
            node.executor = None
            node.mailbox.detach()

    def wake(self) -> None:
        """Let a waiting executor look for work and at its context again."""
        self._queue.put(None)

    def create_task(self, callback: Callable[..., Any] | Coroutine[Any, Any, Any], *args: Any, **kwargs: Any) -> Task:
        """Let the thread that spins call a function or carry out a coroutine; returns its future."""
        work = callback if isinstance(callback, Coroutine) else partial(callback, *args, **kwargs)
        return submit(self._mailbox, work)

    def shutdown(self) -> None:
        """End spinning and let go of all nodes."""
        self._is_shutdown = True
        for node in list(self._nodes):
            self.remove_node(node)
        self.wake()

    def spin(self) -> None:
        """Call callbacks until the executor is shut down."""
        while self.context.ok() and not self._is_shutdown:
            self.spin_once()

    def spin_until_future_complete(self, future: Future, timeout_sec: float | None = None) -> None:
        """Call callbacks until a future is done, ``timeout_sec`` at most; None or negative is no limit."""
        future.add_done_callback(lambda _: self.wake())
        deadline = deadline_after(timeout_sec)
        while self.context.ok() and not (future.done() or self._is_shutdown):
            self._spin_once(deadline, future)
            if time.monotonic() >= deadline:
                return

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Call one callback, waiting for it if need be, ``timeout_sec`` at most; None or negative is no limit."""
        self._spin_once(deadline_after(timeout_sec), None)

    def _spin_once(self, deadline: float, until: Future | None) -> None:
        while True:
            if not self.context.ok():
                raise ExternalShutdownException("the context was shut down")
            timer, wait = self._find_next_timer()
            queued = not self._queue.empty()
            # Timers and messages take turns, so that a fast timer cannot keep messages waiting for ever.
            if timer is not None and wait <= 0 and not (self._timer_was_last and queued):
                self._timer_was_last = True
                timer.advance()
                call(self._mailbox, timer.callback)
                return
            self._timer_was_last = False
            if not queued:
                left = deadline - time.monotonic()
                if left <= 0 or self._is_shutdown or (until is not None and until.done()):
                    return
                wait = min(wait, left)
            try:
                work = self._queue.get(timeout=0 if queued else min(wait, _LONGEST_WAIT_S))
            except Empty:
                continue
            if work is not None and work():
                return

    def _find_next_timer(self) -> tuple[Timer | None, float]:
        """The timer that is due first, and the time until then [s]."""
        left = [(timer.time_until_next_call(), timer) for node in self._nodes for timer in node.timers]
        # If only messages advance the clock, waiting for a time is of no use: messages wake the executor.
        timers = [(due, timer) for due, timer in left if due <= 0 or not timer.clock.is_driven]
        due, first = min(timers, key=lambda each: each[0], default=(float("inf"), None))
        return first, due / S_TO_NS


class SingleThreadedExecutor(Executor):
    """The only kind of executor here; rclpy has others."""
