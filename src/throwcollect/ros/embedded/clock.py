"""Clocks: the system's, a steady one, and ROS time, which is the system's until a simulation provides it."""

from __future__ import annotations

import time as system

from throwcollect.ros.embedded.time import ClockType, Time


class Clock:
    """A clock.

    Args:
        clock_type: Kind of the clock. `ROSClock` is the one for ROS time.
    """

    def __init__(self, *, clock_type: ClockType = ClockType.SYSTEM_TIME) -> None:
        self.clock_type = clock_type

    def now(self) -> Time:
        """Current time of this clock."""
        steady = self.clock_type is ClockType.STEADY_TIME
        return Time(nanoseconds=system.monotonic_ns() if steady else system.time_ns(), clock_type=self.clock_type)

    def timer_now_ns(self) -> int:
        """Time by which timers of this clock run [ns]: a steady one, so that a corrected system clock delays none."""
        return system.monotonic_ns()

    @property
    def is_driven(self) -> bool:
        """Whether this clock advances by messages alone, so that waiting for it is waiting for a message."""
        return False


class ROSClock(Clock):
    """ROS time: that of the simulation while it is active, otherwise the system's."""

    def __init__(self) -> None:
        super().__init__(clock_type=ClockType.ROS_TIME)
        self._override_ns = 0
        self._active = False

    @property
    def ros_time_is_active(self) -> bool:
        """Whether the time is the simulation's."""
        return self._active

    @property
    def is_driven(self) -> bool:  # noqa: D102 - see `Clock`
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
        return Time(nanoseconds=nanoseconds, clock_type=ClockType.ROS_TIME)

    def timer_now_ns(self) -> int:  # noqa: D102 - see `Clock`
        return self._override_ns if self._active else system.monotonic_ns()
