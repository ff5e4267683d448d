"""How throws into a bin are judged, and the bin as boxes."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from tests.unit.tasks.throw.episodes import GRAVITY, ORIGIN, RELEASE_S, VELOCITY, episode, landing_time

from throwcollect.config.schema import Config
from throwcollect.tasks.task import task_of

HELD = ("spoon", 0.0, RELEASE_S)
RADIUS = Config().ball.radius_m
RIM = 0.25


def place_at(height: float) -> tuple[float, float]:
    """Where the ball's lowest point comes down to a height: x and y."""
    flown = landing_time(height + RADIUS) - RELEASE_S
    x, y, _ = ORIGIN + VELOCITY * flown
    return float(x), float(y)


HIT_X, HIT_Y = place_at(RIM)
FLOOR_S = landing_time(0.01 + RADIUS)


def config(*, x: float = HIT_X, y: float = HIT_Y, wall: object = None, **bin_keys: float) -> Config:
    task = {"name": "throw_into", "bin": {"x_m": x, "y_m": y, "depth_m": RIM, **bin_keys}, "wall": wall}
    return Config.model_validate({"task": task})


def judge(made: Config, *contacts: tuple[str, float, float | None], rests_at=None, end_reason: str = "landed"):
    samples, header = episode(made, contacts=(HELD, *contacts), end_reason="rest" if rests_at else end_reason)
    if rests_at:
        samples.object_position[-1], samples.object_linear_velocity[-1] = rests_at, 0.0
    task = task_of(made)
    return task.judge(samples, header, task.trajectory())


def test_a_ball_that_rests_in_the_bin_is_in_it() -> None:
    floor = ("bin_floor", FLOOR_S, None)
    result = judge(config(), floor, rests_at=(HIT_X + 0.19, HIT_Y, 0.01 + RADIUS))
    assert (result.outcome, result.reason) == ("in_bin", None)
    assert result.landing.position == pytest.approx((HIT_X, HIT_Y, RIM + RADIUS), abs=1e-9)
    assert result.bin_miss_m == pytest.approx(0.0, abs=1e-9)
    assert result.rest.position == (HIT_X + 0.19, HIT_Y, 0.01 + RADIUS)
    assert (result.bounces, result.recontacts) == (1, 0)


def test_the_bin_may_be_turned() -> None:
    # In the direction of world's x, a square that is turned by 45 degrees reaches as far as half of its diagonal.
    turned = config(x=HIT_X - 0.25, yaw_rad=math.pi / 4)
    assert judge(turned, rests_at=(HIT_X, HIT_Y, 0.035)).outcome == "in_bin"
    assert judge(config(x=HIT_X - 0.25), rests_at=(HIT_X, HIT_Y, 0.035)).outcome == "beyond"


@pytest.mark.parametrize(
    ("made", "contacts", "outcome", "said"),
    [
        (config(x=HIT_X + 0.3), (), "short", "the ball came down to the rim at x"),
        (config(x=HIT_X - 0.3), (), "beyond", "the ball came down to the rim at x"),
        (config(), (("bin_floor", FLOOR_S, FLOOR_S + 0.01), ("ground", 1.4, None)), "bounced_out", "came into the bin"),
        (config(x=HIT_X + 0.3), (("bin_front", 1.1, 1.11),), "rim_hit", "touched bin_front at 1.100 s"),
        (config(wall={}), (("wall", 1.0, 1.01), ("bin_back", 1.1, 1.11)), "wall_hit", "touched wall at 1.000 s"),
        (config(), (("arm_right_5_link", 0.9, 0.91),), "self_hit", "touched arm_right_5_link"),
        (config(), (("spoon", 0.9, 0.91),), "recaught", "touched the ball again"),
    ],
)
def test_a_miss_says_what_kept_the_ball_out(made: Config, contacts, outcome: str, said: str) -> None:
    result = judge(made, *contacts)
    assert result.outcome == outcome
    assert said in result.reason


def test_a_ball_that_still_rolls_in_the_bin_is_no_success() -> None:
    result = judge(config(), ("bin_floor", 1.38, None), end_reason="timeout")
    assert (result.outcome, result.reason) == ("timeout", "the ball had not come to rest in the bin")


def test_the_ball_counts_at_the_end_whatever_it_touched_on_its_way() -> None:
    contacts = ("wall", 0.9, 0.91), ("bin_back", 1.1, 1.11), ("bin_floor", 1.3, None)
    result = judge(config(wall={"x_m": 1.0}), *contacts, rests_at=(HIT_X, HIT_Y, 0.035))
    assert result.outcome == "in_bin"
    assert result.bounces == 3
    assert result.landing is None


def test_the_clearance_is_that_of_the_lowest_point_over_the_wall() -> None:
    result = judge(config(wall={"x_m": 1.0, "height_m": 0.5}))
    flown = (1.0 - ORIGIN[0]) / VELOCITY[0]
    height = ORIGIN[2] + VELOCITY[2] * flown - GRAVITY * flown**2 / 2
    assert result.wall_clearance_m == pytest.approx(height - RADIUS - 0.5, abs=1e-4)


def test_a_mark_without_walls_is_judged_as_a_throw_is() -> None:
    x, y = place_at(0.0)
    samples, header = episode()
    flat = config(x=x, y=y, depth_m=0.0)
    task, throw = task_of(flat), task_of(Config())
    result, other = (each.judge(samples, header, each.trajectory()) for each in (task, throw))
    assert (result.outcome, other.outcome) == ("in_bin", "landed")
    for field in fields(other):
        if field.name != "outcome":
            assert getattr(result, field.name) == getattr(other, field.name)
    assert flat.task.bodies == {}


def test_the_walls_of_a_bin_enclose_its_opening() -> None:
    made = config(x=1.0, y=2.0, size_x_m=0.4, size_y_m=0.6, depth_m=0.3, height_m=0.5, wall_m=0.02)
    spans = {}
    for name, box in made.task.bodies.items():
        centre, half = np.array(box.position_m), np.array(box.size_m) / 2
        spans[name] = np.stack([centre - half, centre + half]).round(9).tolist()
    assert spans == {
        "bin_floor": [[0.78, 1.68, 0.5], [1.22, 2.32, 0.52]],
        "bin_front": [[0.78, 1.68, 0.52], [0.8, 2.32, 0.8]],
        "bin_back": [[1.2, 1.68, 0.52], [1.22, 2.32, 0.8]],
        "bin_right": [[0.8, 1.68, 0.52], [1.2, 1.7, 0.8]],
        "bin_left": [[0.8, 2.3, 0.52], [1.2, 2.32, 0.8]],
    }


def test_a_throw_that_touches_a_body_before_it_lands_is_no_landing() -> None:
    table = {"shape": "box", "size_m": [0.4, 0.4, 0.1], "position_m": [1.2, -0.2, 0.6]}
    made = Config.model_validate({"scene": {"bodies": {"table": table}}})
    samples, header = episode(made, contacts=(HELD, ("table", 1.1, 1.11)))
    task = task_of(made)
    result = task.judge(samples, header, task.trajectory())
    assert (result.outcome, result.reason, result.landing) == ("body_hit", "the ball touched table at 1.100 s", None)
    landed = replace(header, contacts=header.contacts[:1])
    assert task.judge(samples, landed, task.trajectory()).outcome == "landed"
