"""How slides are judged, and the table and the puck as bodies."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from tests.unit.tasks.throw.episodes import episode

from throwcollect.config.schema import Config
from throwcollect.robots.surroundings import bodies_of, object_of
from throwcollect.tasks.slide.slide_result import SlideResult
from throwcollect.tasks.task import task_of

CONFIG = Config.model_validate({"tool": {"name": "paddle"}, "task": {"name": "slide"}})
TASK = CONFIG.task
HEIGHT = TASK.table.height_m + TASK.puck.height_m / 2
START = np.array([TASK.puck.x_m, TASK.puck.y_m, HEIGHT])
HIT_S, LEFT_S, SPEED, BRAKING = 0.2, 0.4, 1.2, 0.2 * 9.81
PUSHED_M = SPEED * (LEFT_S - HIT_S) / 2
TABLE, PUSH = ("table", 0.0, None), ("paddle", HIT_S, LEFT_S)


def judge(*contacts: tuple[str, float, float | None], end_reason: str = "rest", config: Config = CONFIG) -> SlideResult:
    """Judge a puck that is pushed along x with constant acceleration, and slides until friction stops it."""
    samples, header = episode(config, contacts=contacts, end_reason=end_reason, duration_s=2.0)
    times = (samples.stamps_ns - samples.stamps_ns[0]) / 1e9
    pushed, slid = (np.clip(times, *span) - span[0] for span in ((HIT_S, LEFT_S), (LEFT_S, LEFT_S + SPEED / BRAKING)))
    samples.object_position[:] = START
    samples.object_position[:, 0] += pushed**2 / 2 * SPEED / (LEFT_S - HIT_S) + SPEED * slid - BRAKING * slid**2 / 2
    samples.object_linear_velocity[:] = 0.0
    speed = SPEED * pushed / (LEFT_S - HIT_S) - BRAKING * slid
    samples.object_linear_velocity[:, 0] = speed
    samples.object_orientation_xyzw[-1] = (0.0, 0.0, np.sin(0.4), np.cos(0.4))
    task = task_of(config)
    return task.judge(samples, header, task.trajectory())


def test_a_puck_that_is_pushed_once_rests_where_friction_stops_it() -> None:
    result = judge(TABLE, PUSH)
    assert (result.outcome, result.reason, result.pushes) == ("at_rest", None, 1)
    assert (result.hit.time_s, result.hit.position) == (HIT_S, pytest.approx(START))
    assert result.leave.time_s == pytest.approx(LEFT_S)
    assert result.leave.position == pytest.approx(START + np.array([PUSHED_M, 0, 0]), abs=1e-6)
    assert result.puck_speed_mps == pytest.approx(SPEED, abs=1e-6)
    assert result.slide_distance_m == pytest.approx(SPEED**2 / (2 * BRAKING), abs=1e-6)
    assert result.rest.position[0] == pytest.approx(START[0] + PUSHED_M + SPEED**2 / (2 * BRAKING), abs=1e-6)
    assert result.rest_yaw_rad == pytest.approx(0.8)


def test_contacts_with_little_time_in_between_are_one_push() -> None:
    result = judge(TABLE, ("paddle", HIT_S, 0.25), ("paddle", 0.34, LEFT_S))
    assert (result.outcome, result.pushes) == ("at_rest", 1)
    assert result.leave.time_s == pytest.approx(LEFT_S)
    again = judge(TABLE, ("paddle", HIT_S, 0.25), ("paddle", 0.36, LEFT_S))
    assert (again.outcome, again.pushes) == ("pushed_twice", 2)


def test_a_puck_that_the_tool_holds_to_the_end_has_not_left() -> None:
    result = judge(TABLE, ("paddle", HIT_S, None))
    assert (result.outcome, result.leave, result.puck_speed_mps, result.slide_distance_m) == ("at_rest", *[None] * 3)


@pytest.mark.parametrize(
    ("contacts", "end_reason", "outcome", "said"),
    [
        ((TABLE,), "rest", "missed_puck", "the paddle never touched the puck"),
        ((TABLE, PUSH), "landed", "off_table", "the puck fell from the table"),
        ((TABLE, PUSH), "timeout", "timeout", "had not come to rest"),
        ((TABLE, PUSH, ("arm_right_7_link", 0.5, 0.51)), "rest", "robot_hit", "touched arm_right_7_link at 0.500 s"),
        ((TABLE, PUSH, ("ground", 0.5, 0.51)), "rest", "at_rest", "None"),
    ],
)
def test_what_keeps_a_puck_from_a_rest_after_one_push(contacts, end_reason: str, outcome: str, said: str) -> None:
    result = judge(*contacts, end_reason=end_reason)
    assert result.outcome == outcome
    assert said in str(result.reason)
    assert (result.rest is None) == (end_reason != "rest")


def test_a_trial_ends_when_the_puck_is_below_the_table() -> None:
    ends = task_of(CONFIG).end_rule()
    on, off = (0.0, 0.0, TASK.table.height_m + 0.001), (0.0, 0.0, TASK.table.height_m - 0.001)
    assert ends(on, on, {"table"}) is None
    assert ends(on, off, set()) == "landed"


def test_the_puck_lies_on_the_table() -> None:
    assert object_of(CONFIG).placement.xyz == pytest.approx(START)
    (table,) = bodies_of(CONFIG)
    assert table.placement.xyz[2] + TASK.table.thickness_m / 2 == pytest.approx(TASK.table.height_m)
    with pytest.raises(ValidationError, match=r"puck\.y_m: should be on the table, -1 to 0, got 0\.1"):
        Config.model_validate({"task": {"name": "slide", "puck": {"y_m": 0.1}}})
