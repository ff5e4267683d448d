"""How messages put what they count."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """A number and what it counts, such as ``1 trial`` and ``0 trials``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
