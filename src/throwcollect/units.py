"""Units: those that names end with, those in which people are shown lengths and angles, and nanoseconds."""

from __future__ import annotations

import math

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
    "_n": "N",
    "_s": "s",
}
_ASCII = str.maketrans({"²": "^2", "³": "^3"})
_OF_SLIDING = {"_radps2": "_mps2", "_radps": "_mps", "_rad": "_m", "_nm": "_n"}
_SHOWN_AS = {"m": (100.0, "cm"), "rad": (math.degrees(1), "°")}
_LEAST_SHOWN = 0.01
"""A smaller number is shown with two significant digits, because its first two decimals would be zeros."""


def unit_of_name(name: str) -> str:
    """Find the unit that a name of a key or column ends with, such as ``m/s²`` for ``gravity_mps2``, or empty."""
    return next((unit for suffix, unit in _SUFFIXES.items() if name.endswith(suffix)), "")


def ascii_unit(unit: str) -> str:
    """Write a unit in ASCII, such as ``m/s^2``; ``1`` for counts and shares."""
    return unit.translate(_ASCII) or "1"


def choose_shown_unit(unit: str) -> tuple[float, str]:
    """Choose the unit in which people are shown distances: centimetres for metres, degrees for radians.

    Returns:
        The factor to this unit, and the unit.
    """
    return _SHOWN_AS.get(unit, (1.0, unit))


def format_distance(distance: float | None, unit: str) -> str:
    """Write a distance of places or of angles for people, such as ``1.24 cm`` and ``0.57°``; ``-`` for None."""
    if distance is None:
        return "-"
    factor, shown = choose_shown_unit(unit)
    if unit not in _SHOWN_AS:
        return f"{distance:.3g} {shown}".rstrip()
    number = factor * distance
    digits = ".2f" if number == 0 or number >= _LEAST_SHOWN else ".2g"
    return f"{number:{digits}}{'' if shown == '°' else ' '}{shown}"


def name_sliding(name: str) -> str:
    """Name a quantity of a joint that slides, by its name for joints that turn: ``_m`` for ``_rad`` and so on."""
    suffix = next((each for each in _OF_SLIDING if name.endswith(each)), "")
    return name.removesuffix(suffix) + _OF_SLIDING.get(suffix, "")
