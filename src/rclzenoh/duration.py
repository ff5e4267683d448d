"""Periods between two points in time."""

from __future__ import annotations

import time
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
"""The longest duration, which stands for no limit."""


def deadline_after(timeout_s: float | None) -> float:
    """Time of `time.monotonic` at which a wait ends [s]; never if the timeout is None or negative, as in rclpy."""
    return float("inf") if timeout_s is None or timeout_s < 0 else time.monotonic() + timeout_s
