"""Timers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclzenoh.time import ROSClock


class Timer:
    """Calls back once a period of its clock; periods that were missed are skipped."""

    def __init__(self, callback: Callable[[], Any], timer_period_ns: int, clock: ROSClock) -> None:
        if timer_period_ns < 0:
            raise ValueError(f"period must not be negative, got {timer_period_ns} ns")
        self.callback = callback
        self.timer_period_ns = timer_period_ns
        self.clock = clock
        self._next = clock.timer_now_ns() + timer_period_ns

    def time_until_next_call(self) -> int:
        """Time left [ns], not positive when due."""
        now = self.clock.timer_now_ns()
        if self._next - now > self.timer_period_ns:
            # The clock has jumped back, or has changed between simulated and real time, so `_next` is meaningless.
            self._next = now + self.timer_period_ns
        return self._next - now

    def advance(self) -> None:
        """Begin the next period; called before the callback."""
        now = self.clock.timer_now_ns()
        self._next += self.timer_period_ns
        if self._next <= now and self.timer_period_ns:
            self._next += (now - self._next) // self.timer_period_ns * self.timer_period_ns + self.timer_period_ns
