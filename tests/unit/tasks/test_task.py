from __future__ import annotations

import pytest

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.robots.talos import TALOS
from throwcollect.tasks.task import task_of


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


def test_motion_that_cannot_be_computed_is_refused():
    weights = {"arm_right_4_joint": [1e6] * 20}
    with pytest.raises(ConfigError, match="settle"):
        task_of(Config(task={"trajectory": {"family": "dmp", "weights": weights}})).trajectory()
