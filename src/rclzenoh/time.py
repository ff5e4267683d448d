"""Times, durations, timers, and the clock of ROS time: the simulation's time if it provides one, or the system's."""

from __future__ import annotations

import time as system
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclzenoh.interfaces.msg import Time as TimeMessage

S_TO_NS = 1_000_000_000
"""Nanoseconds in a second."""


@dataclass(frozen=True, kw_only=True)
class Duration:
    """Period of time.

    Attributes:
        nanoseconds: Its length [ns].
    """

    nanoseconds: int = 0

    def __str__(self) -> str:
        return "Infinite" if self == Infinite else f"{self.nanoseconds} nanoseconds"


Infinite = Duration(nanoseconds=2**63 - 1)
"""The longest duration, which stands for no limit."""


@dataclass(frozen=True, kw_only=True)
class Time:
    """Point in time.

    Attributes:
        nanoseconds: Time since the epoch of its clock [ns].
    """

    nanoseconds: int = 0

    def to_msg(self) -> TimeMessage:
        """The time as builtin_interfaces/msg/Time."""
        seconds, nanoseconds = divmod(self.nanoseconds, S_TO_NS)
        return TimeMessage(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: TimeMessage) -> Time:
        """The time that a builtin_interfaces/msg/Time holds."""
        return cls(nanoseconds=msg.sec * S_TO_NS + msg.nanosec)


class ROSClock:
    """A clock of ROS time; real time is counted from the epoch [ns], as is that of a simulation."""

    def __init__(self) -> None:
        self._override_ns = 0
        self._active = False

    @property
    def is_driven(self) -> bool:
        """Whether only messages advance the clock, so that waiting for a time is of no use."""
        return self._active

    def activate(self, active: bool) -> None:
        """Use the simulation's time, or the system's again."""
        self._active = active

    def set_ros_time_override(self, time: Time) -> None:
        """Set the simulation's time."""
        self._override_ns = time.nanoseconds

    def now(self) -> Time:
        """Current time; 0 while the simulation's time is in use and has not been heard of."""
        nanoseconds = self._override_ns if self._active else system.time_ns()
        return Time(nanoseconds=nanoseconds)

    def timer_now_ns(self) -> int:
        """Time by which timers run [ns]; in real time, that of a steady clock, as the system's may be corrected."""
        return self._override_ns if self._active else system.monotonic_ns()


class Timer:
    """Calls back once a period of its clock; periods that were missed are skipped."""

    def __init__(self, callback: Callable[[], Any], timer_period_ns: int, clock: ROSClock) -> None:
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


def deadline_after(timeout_s: float | None) -> float:
    """Time of `time.monotonic` at which a wait ends [s]; never if the timeout is None or negative, as in rclpy."""
    return float("inf") if timeout_s is None or timeout_s < 0 else system.monotonic() + timeout_s
