"""Talos of PAL Robotics, as example-robot-data describes it.

Names and order of joints and controllers, and the controllers' tolerances, are those of PAL's ROS 2 controller
configuration (talos_controller_configuration, humble-devel 2.0).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from throwcollect.errors import ConfigError
from throwcollect.robots.imported import find_examples
from throwcollect.robots.robot import Robot

_DATA = "example-robot-data/robots/talos_data"


def _number_joints(limb: str, count: int) -> tuple[str, ...]:
    return tuple(f"{limb}_{number}_joint" for number in range(1, count + 1))


def _find_share() -> Path:
    share = find_examples()
    if not (share / _DATA).is_dir():
        raise ConfigError(f"{share / _DATA}: the robot's description is missing", hint="reinstall example-robot-data")
    return share


TALOS = Robot(
    name="talos",
    title="Talos",
    controllers=MappingProxyType(
        {
            "arm_left_controller": _number_joints("arm_left", 7),
            "arm_right_controller": _number_joints("arm_right", 7),
            "leg_left_controller": _number_joints("leg_left", 6),
            "leg_right_controller": _number_joints("leg_right", 6),
            "torso_controller": _number_joints("torso", 2),
            "head_controller": _number_joints("head", 2),
            "gripper_left_controller": ("gripper_left_joint",),
            "gripper_right_controller": ("gripper_right_joint",),
        }
    ),
    goal_tolerance_rad=0.02,
    goal_time_s=0.6,
    stopped_velocity_radps=0.05,
    share=_find_share,
    urdf=f"{_DATA}/robots/talos_reduced.urdf",
    srdf=f"{_DATA}/srdf/talos.srdf",
    rest="half_sitting",
    hand="gripper_right_base_link",
    # The fingers of the right gripper reach into the handle of the tool.
    open_hand="gripper_right_",
    holding=("gripper_right_", "wrist_right_", "arm_right_5_", "arm_right_6_", "arm_right_7_"),
    rigid=("gripper_left_", "gripper_right_"),
)
"""The humanoid with its 32 actuated joints; the hand is the right gripper."""

TALOS_LEFT = replace(
    TALOS,
    name="talos_left",
    title="Talos (left hand)",
    hand="gripper_left_base_link",
    open_hand="gripper_left_",
    holding=("gripper_left_", "wrist_left_", "arm_left_5_", "arm_left_6_", "arm_left_7_"),
)
"""The same humanoid with the tool in its left gripper."""
