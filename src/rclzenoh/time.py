"""Points in time."""

from __future__ import annotations

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
