"""Periods between two points in time."""

from __future__ import annotations

from dataclasses import dataclass

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
"""Longest duration; stands for no limit."""
