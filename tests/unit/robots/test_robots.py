"""What holds for every robot of the table, and for one of another package."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.members import names_of
from throwcollect.robots.clearance import Clearance
from throwcollect.robots.importing import find_robot
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.robot import Robot, joint_limits

sys.path.append(str(Path(__file__).parents[2] / "plugins"))

from planar_arm.robot import PLANAR_ARM

ROBOTS = [*(find_robot(name) for name in names_of("robots")), PLANAR_ARM]

of_every_robot = pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)


@of_every_robot
def test_every_joint_has_one_controller(robot: Robot) -> None:
    assert len(set(robot.joints)) == len(robot.joints) > 0
    for controller, joints in robot.controllers.items():
        assert {robot.controller_of(joint) for joint in joints} == {controller}
    with pytest.raises(KeyError, match="tail_joint"):
        robot.controller_of("tail_joint")


@of_every_robot
def test_the_posture_at_rest_is_within_the_limits(robot: Robot) -> None:
    limits = joint_limits(robot)
    posture = np.array([robot.rest_posture[joint] for joint in robot.joints])
    assert tuple(robot.rest_posture) == robot.joints
    assert limits.lower.shape == (len(robot.joints),)
    assert np.all((limits.lower <= posture) & (posture <= limits.upper))
    assert np.all(limits.velocity > 0)
    assert np.all(limits.effort > 0)


def test_a_robot_without_collision_shapes_never_comes_too_close_to_itself(tmp_path: Path) -> None:
    text = re.sub("<collision>.*?</collision>", "", PLANAR_ARM.urdf_path.read_text(), flags=re.DOTALL)
    (tmp_path / "arm.urdf").write_text(text)
    arm = replace(PLANAR_ARM, share=lambda: tmp_path, urdf="arm.urdf", srdf=str(PLANAR_ARM.srdf_path))
    clearance = Clearance(arm, joint_model(arm), Config().tool)
    assert clearance.first_approach(np.zeros((3, 2))) is None
