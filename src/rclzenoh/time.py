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
    """The clock of a node: the system's, counted from the epoch, or the node's own once it is set."""

    def __init__(self) -> None:
        self._override: Time | None = None

    def set_ros_time_override(self, time: Time) -> None:
        """Show this time until the next one is set."""
        self._override = time

    def now(self) -> Time:
        """Current time."""
        return Time(nanoseconds=system.time_ns()) if self._override is None else self._override


class Timer:
    """Calls back once a period of a steady clock; periods that were missed are skipped."""

    def __init__(self, callback: Callable[[], Any], timer_period_ns: int) -> None:
        self.callback = callback
        self.timer_period_ns = timer_period_ns
        self._next = system.monotonic_ns() + timer_period_ns

    def time_until_next_call(self) -> int:
        """Time left [ns], not positive when due."""
        return self._next - system.monotonic_ns()

    def advance(self) -> None:
        """Begin the next period; called before the callback."""
        self._next += self.timer_period_ns
        late = -self.time_until_next_call()
        if late >= 0 and self.timer_period_ns:
            self._next += (late // self.timer_period_ns + 1) * self.timer_period_ns


def deadline_after(timeout_s: float | None) -> float:
    """Time of `time.monotonic` at which a wait ends [s]; never if the timeout is None or negative, as in rclpy."""
    return float("inf") if timeout_s is None or timeout_s < 0 else system.monotonic() + timeout_s
