"""What a controller says of its log records to whoever shows them."""

from __future__ import annotations

REPEATED = "repeated"
"""Attribute of records that clients may cause as often as they like: what they are about. All others are one line for
each goal, stop or decision."""


def mark_repeated(about: str) -> dict[str, str]:
    """What marks a record as one of many about the same: whoever shows it may leave some out."""
    return {REPEATED: about}
