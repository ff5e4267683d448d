"""Finds the units that names end with, and knows the number of nanoseconds in a second."""

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
    """Find the unit that a name of a key or column ends with, such as ``m/s²`` for ``gravity_mps2``, or empty."""
    return next((unit for suffix, unit in _SUFFIXES.items() if name.endswith(suffix)), "")
