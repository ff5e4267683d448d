"""Units of names, and distances as people are shown them."""

from __future__ import annotations

import math

import pytest

from throwcollect.units import choose_shown_unit, format_distance


@pytest.mark.parametrize(
    ("distance", "unit", "shown"),
    [
        (0.01234, "m", "1.23 cm"),
        (3.18e-05, "m", "0.0032 cm"),
        (0.0, "m", "0.00 cm"),
        (0.01, "rad", "0.57°"),
        (3e-05, "rad", "0.0017°"),
        (0.01234, "s", "0.0123 s"),
        (0.5, "", "0.5"),
        (None, "m", "-"),
    ],
)
def test_a_distance_is_shown_in_centimetres_degrees_or_its_own_unit(
    distance: float | None, unit: str, shown: str
) -> None:
    assert format_distance(distance, unit) == shown


def test_the_unit_that_is_shown_comes_with_the_factor_to_it() -> None:
    assert choose_shown_unit("m") == (100.0, "cm")
    assert choose_shown_unit("rad") == (pytest.approx(180 / math.pi), "°")
    assert choose_shown_unit("s") == (1.0, "s")
