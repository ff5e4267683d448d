"""Futures, and the tasks in which callbacks and coroutines run.

A task waits in the mailbox of its node, so the executor that the node is in at that time carries it on.
"""

from __future__ import annotations

import inspect
import threading
from collections.abc import Callable, Coroutine, Generator
from enum import Enum
from functools import partial
from typing import Any

from rclzenoh.mailbox import Mailbox


class _State(Enum):
    PENDING = "pending"
    CANCELLED = "cancelled"
    FINISHED = "finished"


class Future:
    """An outcome that will be known later; callbacks can await it."""

    def __init__(self) -> None:
        self._state = _State.PENDING
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Any], Any]] = []
        self._waiting: list[Task] = []
        self._lock = threading.Lock()
        self._mailbox: Mailbox | None = None

    def __await__(self) -> Generator[Future, None, Any]:
        while self._state is _State.PENDING:
            yield self
        return self.result()

    def done(self) -> bool:
        """Whether there is a result or an exception."""
        return self._state is _State.FINISHED

    def cancelled(self) -> bool:
        """Whether the future was cancelled."""
        return self._state is _State.CANCELLED

    def result(self) -> Any:
        """The result; None as long as there is none."""
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self) -> BaseException | None:
        """The exception, if that is the outcome."""
        return self._exception

    def set_result(self, result: Any) -> None:
        """Set the outcome."""
        self._finish(_State.FINISHED, result=result)

    def set_exception(self, exception: BaseException) -> None:
        """Set an exception as the outcome."""
        self._finish(_State.FINISHED, exception=exception)

    def cancel(self) -> None:
        """Give up; does nothing if the outcome is known already."""
        if self._state is _State.PENDING:
            self._finish(_State.CANCELLED)

    def add_done_callback(self, callback: Callable[[Any], Any]) -> None:
        """Call back with this future once the outcome is known, or now if it is."""
        with self._lock:
            if self._state is _State.PENDING:
                self._callbacks.append(callback)
                return
        self._call(callback)

    def resume_when_done(self, task: Task) -> None:
        """Continue a task once the outcome is known."""
        with self._lock:
            if self._state is _State.PENDING:
                self._waiting.append(task)
                return
        task.schedule()

    def call_back_through(self, mailbox: Mailbox) -> None:
        """Let the thread that spins call done callbacks, instead of the thread that sets the outcome."""
        self._mailbox = mailbox

    def _finish(self, state: _State, *, result: Any = None, exception: BaseException | None = None) -> None:
        with self._lock:
            self._result, self._exception, self._state = result, exception, state
            callbacks, self._callbacks = self._callbacks, []
            waiting, self._waiting = self._waiting, []
        # This happens after the lock is released, because a callback may use this future.
        for task in waiting:
            task.schedule()
        for callback in callbacks:
            self._call(callback)

    def _call(self, callback: Callable[[Any], Any]) -> None:
        if self._mailbox is None:
            callback(self)
        else:
            submit(self._mailbox, partial(callback, self))


class Task(Future):
    """A function or coroutine that the thread that spins carries out; its outcome is that of the task.

    Args:
        work: The coroutine, or a function without arguments, which may return one.
        mailbox: The mailbox in which the task waits until it is carried on.
    """

    def __init__(self, work: Callable[[], Any] | Coroutine[Any, Any, Any], mailbox: Mailbox) -> None:
        super().__init__()
        self.call_back_through(mailbox)
        self.mailbox = mailbox
        self._work = work

    def schedule(self) -> None:
        """Let the thread that spins carry on with this task."""
        self.mailbox.submit(self)

    def run(self) -> bool:
        """Carry on until the task ends or awaits something; returns whether there was anything to do."""
        if self.done() or self.cancelled():
            return False
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
            self.set_exception(error)
            raise
        else:
            if isinstance(awaited, Future):
                awaited.resume_when_done(self)
            else:
                self.schedule()
        return True

    def cancel(self) -> None:
        """End the coroutine at the point where it waits."""
        if isinstance(self._work, Coroutine) and not self.done():
            self._work.close()
        super().cancel()


def submit(mailbox: Mailbox, work: Callable[[], Any] | Coroutine[Any, Any, Any]) -> Task:
    """Let the thread that spins call a function without arguments, or carry out a coroutine."""
    task = Task(work, mailbox)
    task.schedule()
    return task


def start(mailbox: Mailbox, coroutine: Coroutine[Any, Any, Any]) -> Task:
    """Begin to carry out a coroutine now."""
    task = Task(coroutine, mailbox)
    task.run()
    return task


def call(mailbox: Mailbox, callback: Callable[..., Any], *args: Any) -> None:
    """Call a callback now; a coroutine function runs up to the point where it first awaits something."""
    result = callback(*args)
    if result is not None and inspect.iscoroutine(result):
        start(mailbox, result)
