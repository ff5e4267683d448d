"""ROS time, which is the system's until a simulation provides it."""

from __future__ import annotations

import time as system

from rclzenoh.time import Time


class ROSClock:
    """ROS time: that of the simulation while it is active, otherwise the system's."""

    def __init__(self) -> None:
        self._override_ns = 0
        self._active = False

    @property
    def is_driven(self) -> bool:
        """Whether the clock advances by messages alone, so that waiting for it is waiting for a message."""
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
        """Time by which timers run [ns]: a steady one in real time, so that a corrected system clock delays none."""
        return self._override_ns if self._active else system.monotonic_ns()
