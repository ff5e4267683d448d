"""Futures, and the tasks in which coroutines run."""

from __future__ import annotations

import threading
from collections.abc import Callable, Coroutine, Generator
from enum import Enum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from throwcollect.ros.embedded.executors import Executor


class _State(Enum):
    PENDING = "pending"
    CANCELLED = "cancelled"
    FINISHED = "finished"


class Future:
    """Outcome that will be known later; can be awaited in callbacks.

    Args:
        executor: Executor that runs the done callbacks; None runs them where the outcome is set.
    """

    def __init__(self, *, executor: Executor | None = None) -> None:
        self._state = _State.PENDING
        self._result: Any = None
        self._exception: BaseException | None = None
        self._callbacks: list[Callable[[Any], Any]] = []
        self._waiting: list[Task] = []
        self._lock = threading.Lock()
        self._executor = executor

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
        """Call something with this future once the outcome is known, or now if it is."""
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

    def use_executor(self, executor: Executor) -> None:
        """Run done callbacks in an executor."""
        self._executor = executor

    def _finish(self, state: _State, *, result: Any = None, exception: BaseException | None = None) -> None:
        with self._lock:
            self._result, self._exception, self._state = result, exception, state
            callbacks, self._callbacks = self._callbacks, []
            waiting, self._waiting = self._waiting, []
        for task in waiting:
            task.schedule()
        for callback in callbacks:
            self._call(callback)

    def _call(self, callback: Callable[[Any], Any]) -> None:
        if self._executor is None:
            callback(self)
        else:
            self._executor.create_task(callback, self)


class Task(Future):
    """A function or coroutine that an executor carries out; its outcome is theirs.

    Args:
        work: The coroutine, or a function without arguments, which may return one.
        executor: The executor.
    """

    def __init__(self, work: Callable[[], Any] | Coroutine[Any, Any, Any], executor: Executor) -> None:
        super().__init__(executor=executor)
        self._scheduler = executor
        self._function = None if isinstance(work, Coroutine) else work
        self._coroutine = work if isinstance(work, Coroutine) else None

    def schedule(self) -> None:
        """Have the executor continue this task."""
        self._scheduler.submit(self)

    def run(self, executor: Executor) -> bool:  # noqa: ARG002 - as all work is run
        """Carry on until the task ends or awaits something.

        Args:
            executor: Executor that spins.

        Returns:
            Whether there was anything to do.

        Raises:
            BaseException: What the function or coroutine raised; it is the task's outcome, too.
        """
        if self.done() or self.cancelled():
            return False
        try:
            if self._function is not None:
                result, self._function = self._function(), None
                if not isinstance(result, Coroutine):
                    self.set_result(result)
                    return True
                self._coroutine = result
            awaited = self._coroutine.send(None) if self._coroutine is not None else None
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
        """Give up the coroutine where it waits."""
        if self._coroutine is not None and not self.done():
            self._coroutine.close()
        super().cancel()
