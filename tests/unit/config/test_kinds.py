from throwcollect.config.kinds import JOINT_NAMES
from throwcollect.robots.talos import JOINTS


def test_the_joints_of_the_configuration_are_those_of_the_robot():
    assert JOINT_NAMES == JOINTS
