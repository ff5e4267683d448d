"""Periods between two points in time."""

from __future__ import annotations

from functools import total_ordering

from throwcollect.interfaces import Message, get_message

S_TO_NS = 1_000_000_000
"""Nanoseconds in a second."""

_LIMIT = 2**63
_DurationMessage = get_message("builtin_interfaces/msg/Duration")


@total_ordering
class Duration:
    """Signed period with a resolution of a nanosecond.

    Args:
        seconds: Seconds, with fraction.
        nanoseconds: Nanoseconds, added to the seconds.
    """

    __slots__ = ("nanoseconds",)

    def __init__(self, *, seconds: float = 0, nanoseconds: int = 0) -> None:
        total = int(seconds * S_TO_NS) + int(nanoseconds)
        if not -_LIMIT <= total < _LIMIT:
            raise OverflowError(f"{total} ns do not fit 64 bits")
        self.nanoseconds = total

    def __repr__(self) -> str:
        return f"Duration(nanoseconds={self.nanoseconds})"

    def __str__(self) -> str:
        return "Infinite" if self == Infinite else f"{self.nanoseconds} nanoseconds"

    def __eq__(self, other: object) -> bool:
        return self.nanoseconds == other.nanoseconds if isinstance(other, Duration) else NotImplemented

    def __lt__(self, other: object) -> bool:
        return self.nanoseconds < other.nanoseconds if isinstance(other, Duration) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.nanoseconds)

    def to_msg(self) -> Message:
        """The duration as builtin_interfaces/msg/Duration."""
        seconds, nanoseconds = divmod(self.nanoseconds, S_TO_NS)
        return _DurationMessage(sec=seconds, nanosec=nanoseconds)

    @classmethod
    def from_msg(cls, msg: Message) -> Duration:
        """The duration that a builtin_interfaces/msg/Duration holds."""
        return cls(nanoseconds=msg.sec * S_TO_NS + msg.nanosec)


Infinite = Duration(nanoseconds=2**63 - 1)
"""Longest duration; stands for no limit."""
