"""Points in time."""

from __future__ import annotations

from dataclasses import dataclass

from throwcollect.interfaces import Message, get_message
from throwcollect.ros.embedded.duration import S_TO_NS

_TimeMessage = get_message("builtin_interfaces/msg/Time")


@dataclass(frozen=True, kw_only=True)
class Time:
    """Point in time.

    Attributes:
        nanoseconds: Time since the epoch of its clock [ns].
    """

    nanoseconds: int = 0

    def to_msg(self) -> Message:
        """The time as builtin_interfaces/msg/Time."""
        seconds, nanoseconds = divmod(self.nanoseconds, S_TO_NS)
        return _TimeMessage(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: Message) -> Time:
        """The time that a builtin_interfaces/msg/Time holds."""
        return cls(nanoseconds=msg.sec * S_TO_NS + msg.nanosec)
