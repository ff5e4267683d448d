"""How bodies of the scene look: their sizes, and their outlines from above and from the side."""

from __future__ import annotations

import math
from typing import Any

import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.surroundings import BodyLook, looks_of


def look_of(shape: str, **keys: Any) -> BodyLook:
    body = {"shape": shape, "position_m": [1.0, 2.0, 3.0], **keys}
    look, _ball = looks_of(Config.model_validate({"scene": {"bodies": {"body": body}}}))
    return look


def measure_area(corners: tuple[tuple[float, float], ...]) -> float:
    """Area of a polygon, above 0 if its corners are counter-clockwise."""
    following = (*corners[1:], corners[0])
    return sum(x * v - u * y for (x, y), (u, v) in zip(corners, following, strict=True)) / 2


def test_an_upright_box_has_four_corners_from_above_and_from_the_side() -> None:
    look = look_of("box", size_m=[0.2, 0.4, 0.6])
    assert set(look.above_m) == {(0.9, 1.8), (1.1, 1.8), (1.1, 2.2), (0.9, 2.2)}
    assert set(look.side_m) == {(0.9, 2.7), (1.1, 2.7), (1.1, 3.3), (0.9, 3.3)}
    assert len(look.above_m) == len(look.side_m) == 4
    assert (look.size_m, look.position_m) == ((0.2, 0.4, 0.6), (1.0, 2.0, 3.0))


def test_turns_are_about_the_axes_of_the_world_one_after_another() -> None:
    # The turn about x lays the longest edge along y, and that about z then along x.
    look = look_of("box", size_m=[0.2, 0.4, 0.6], rpy_rad=[math.pi / 2, 0.0, math.pi / 2])
    assert set(look.above_m) == {(0.7, 1.9), (1.3, 1.9), (1.3, 2.1), (0.7, 2.1)}
    tilted = look_of("box", size_m=[0.2, 0.4, 0.6], rpy_rad=[0.3, 0.4, 0.5])
    assert (len(tilted.above_m), len(tilted.side_m)) == (6, 6)


@pytest.mark.parametrize(
    ("shape", "keys", "size", "above", "side"),
    [
        ("sphere", {"radius_m": 0.5}, (1.0, 1.0, 1.0), math.pi / 4, math.pi / 4),
        ("cylinder", {"radius_m": 0.5, "length_m": 2.0}, (1.0, 1.0, 2.0), math.pi / 4, 2.0),
    ],
)
def test_round_bodies_have_round_outlines(shape: str, keys: Any, size: Any, above: float, side: float) -> None:
    look = look_of(shape, **keys)
    assert look.size_m == size
    assert measure_area(look.above_m) == pytest.approx(above, rel=0.02)
    assert measure_area(look.side_m) == pytest.approx(side, rel=0.02)


def test_bodies_of_a_task_follow_those_of_the_scene() -> None:
    bodies = {"post": {"shape": "sphere", "position_m": [1, 2, 3], "radius_m": 0.1, "color": "#102030"}}
    looks = looks_of(Config.model_validate({"scene": {"bodies": bodies}, "task": {"name": "throw_into", "wall": {}}}))
    names = [look.name for look in looks]
    assert names == ["post", "bin_floor", "bin_front", "bin_back", "bin_right", "bin_left", "wall", "ball"]
    assert (looks[0].color, looks[-2].color) == ("#102030", "#7a7f87")
