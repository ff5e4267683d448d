"""Points in time, and the clock of ROS time: the simulation's while it provides one, otherwise the system's."""

from __future__ import annotations

import time as system
from dataclasses import dataclass

from rclzenoh.duration import S_TO_NS
from rclzenoh.interfaces.msg import Time as TimeMessage


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
