"""Futures, and the tasks in which callbacks and coroutines run.

A task waits in the mailbox of its node, so the executor that the node is in carries it on.
"""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable, Coroutine, Generator
from typing import Any

from rclzenoh.mailbox import Mailbox


class Future:
    """An outcome that will be known later; callbacks can await it."""

    def __init__(self) -> None:
        self._is_done = False
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Any], Any]] = []
        self._lock = threading.Lock()

    def __await__(self) -> Generator[Future, None, Any]:
        while not self._is_done:
            yield self
        return self.result()

    def done(self) -> bool:
        """Whether there is a result or an exception."""
        return self._is_done

    def result(self) -> Any:
        """The result, or the exception, which is raised; None as long as there is none."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def set_result(self, result: Any) -> None:
        """Set the outcome."""
        self._finish(result, None)

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call back with this future once the outcome is known, in the thread that sets it, or now if it is known."""
        with self._lock:
            if not self._is_done:
                self._callbacks.append(callback)
                return
        callback(self)

    def _finish(self, result: Any, exception: BaseException | None) -> None:
        with self._lock:
            self._result, self._exception, self._is_done = result, exception, True
            callbacks, self._callbacks = self._callbacks, []
        # This happens after the lock is released, because a callback may use this future.
        for callback in callbacks:
            callback(self)


class Task(Future):
    """A function or coroutine that the thread that spins carries out; its outcome is that of the task.

    Args:
        work: The coroutine, or a function without arguments, which may return one.
        mailbox: The mailbox in which the task waits until it is carried on.
    """

    def __init__(self, work: Callable[[], Any] | Coroutine[Any, Any, Any], mailbox: Mailbox) -> None:
        super().__init__()
        self._mailbox = mailbox
        self._work = work

    def schedule(self) -> None:
        """Let the thread that spins carry on with this task."""
        self._mailbox.submit(self.run)

    def run(self) -> bool:
        """Carry on until the task ends or awaits something; returns True."""
        try:
            if not isinstance(self._work, Coroutine):
                result = self._work()
                if not isinstance(result, Coroutine):
                    self.set_result(result)
                    return True
                self._work = result
            awaited = self._work.send(None)
        except StopIteration as stop:
            self.set_result(stop.value)
        except BaseException as error:
            self._finish(None, error)
            raise
        else:
            if isinstance(awaited, Future):
                awaited.add_done_callback(lambda _: self.schedule())
            else:
                self.schedule()
        return True


def submit(mailbox: Mailbox, work: Callable[[], Any] | Coroutine[Any, Any, Any]) -> Task:
    """Let the thread that spins call a function without arguments, or carry out a coroutine."""
    task = Task(work, mailbox)
    task.schedule()
    return task


def call(mailbox: Mailbox, callback: Callable[..., Any], *args: Any) -> None:
    """Call a callback now; a coroutine function runs up to the point where it first awaits something."""
    result = callback(*args)
    if result is not None and inspect.iscoroutine(result):
        Task(result, mailbox).run()
