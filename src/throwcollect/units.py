"""Units that names end with, and the number of nanoseconds in a second."""

from __future__ import annotations

NS_PER_S = 1_000_000_000
"""Nanoseconds in a second: stamps are integers [ns], times are floats [s]."""

_SUFFIXES = {
    "_kgpm3": "kg/m³",
    "_per_s": "1/s",
    "_radps2": "rad/s²",
    "_radps": "rad/s",
    "_mps2": "m/s²",
    "_mps": "m/s",
    "_rad": "rad",
    "_kg": "kg",
    "_nm": "N m",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
}


def unit_of_name(name: str) -> str:
    """Unit that the name of a key or a column ends with, such as ``m/s²`` of ``gravity_mps2``; empty if none."""
    return next((unit for suffix, unit in _SUFFIXES.items() if name.endswith(suffix)), "")
