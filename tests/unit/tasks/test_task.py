from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.talos import TALOS
from throwcollect.tasks.result import ResultColumns
from throwcollect.tasks.result_columns import Count, Number, measured
from throwcollect.tasks.task import task_of
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult


def test_a_trajectory_has_the_moving_joints_in_the_order_of_the_robot():
    points = task_of(Config()).trajectory()
    assert set(points.joints) == set(Config().task.end)
    assert list(points.joints) == [joint for joint in TALOS.joints if joint in points.joints]
    assert points.positions.shape == points.velocities.shape == points.accelerations.shape == (26, 5)


def test_each_column_goes_from_the_start_to_the_end_of_its_joint():
    task = Config().task
    points = task_of(Config()).trajectory()
    assert points.positions[0].tolist() == [task.start[joint] for joint in points.joints]
    assert points.positions[-1].tolist() == [task.end[joint] for joint in points.joints]


def test_the_family_of_the_configuration_shapes_the_trajectory():
    config = Config(task={"trajectory": {"family": "dmp"}, "duration_s": 2.0})
    points = task_of(config).trajectory()
    assert points.positions[-1].tolist() == [config.task.end[joint] for joint in points.joints]
    assert points.accelerations[0].any()


@dataclass(frozen=True)
class _CountedResult(ThrowResult):
    bounces: int | None = measured(Count("How often the ball bounced."))
    surface: float | None = measured(Number("How smooth the surface is [-]."))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"surface": "sand"}, "surface: should be a number, is 'sand'"),
        ({"bounces": np.int64(2)}, "bounces: should be a count, is "),
    ],
)
def test_a_result_that_the_table_cannot_hold_is_an_error_when_it_is_written(values: dict[str, Any], said: str) -> None:
    columns = ResultColumns(_CountedResult, ("elbow",), tool="spoon")
    result = _CountedResult(ThrowOutcome.LANDED, bounces=2, surface=0.5)
    assert columns.from_json(ThrowOutcome, columns.to_json(result)) == columns.write(result)
    with pytest.raises((TypeError, ValueError), match=said):
        columns.to_json(replace(result, **values))
