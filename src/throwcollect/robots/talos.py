"""Talos of PAL Robotics: its actuated joints and the controllers that command them.

Names and order are those of PAL's ROS 2 controller configuration (talos_controller_configuration, humble-devel 2.0).
"""

from __future__ import annotations

from types import MappingProxyType


def _numbered(limb: str, count: int) -> tuple[str, ...]:
    return tuple(f"{limb}_{number}_joint" for number in range(1, count + 1))


CONTROLLERS = MappingProxyType(
    {
        "arm_left_controller": _numbered("arm_left", 7),
        "arm_right_controller": _numbered("arm_right", 7),
        "leg_left_controller": _numbered("leg_left", 6),
        "leg_right_controller": _numbered("leg_right", 6),
        "torso_controller": _numbered("torso", 2),
        "head_controller": _numbered("head", 2),
        "gripper_left_controller": ("gripper_left_joint",),
        "gripper_right_controller": ("gripper_right_joint",),
    }
)
"""Joint trajectory controller of each limb and its joints, in order."""

_ROS1_NAMES = MappingProxyType(
    {
        "arm_left_controller": "left_arm_controller",
        "arm_right_controller": "right_arm_controller",
        "leg_left_controller": "left_leg_controller",
        "leg_right_controller": "right_leg_controller",
        "torso_controller": "torso_controller",
        "head_controller": "head_controller",
        "gripper_left_controller": "left_gripper_controller",
        "gripper_right_controller": "right_gripper_controller",
    }
)

JOINTS = tuple(joint for joints in CONTROLLERS.values() for joint in joints)
"""The 32 actuated joints, in the order of every joint state and joint array."""


def controller_of(joint: str) -> str:
    """Controller that commands a joint.

    Args:
        joint: Name of one of `JOINTS`.

    Returns:
        Name of its controller.

    Raises:
        KeyError: If Talos has no such joint.
    """
    for controller, joints in CONTROLLERS.items():
        if joint in joints:
            return controller
    raise KeyError(joint)


def graph_name(controller: str, naming: str) -> str:
    """Name of a controller in the ROS graph.

    Args:
        controller: Name of one of `CONTROLLERS`.
        naming: ``ros2`` or ``ros1``: of which of PAL's controller configurations.
    """
    return _ROS1_NAMES[controller] if naming == "ros1" else controller
