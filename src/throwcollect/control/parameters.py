"""Parameters of a joint trajectory controller, with the names and defaults of ros2_controllers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from throwcollect.errors import ConfigError, Problem

_LONGEST_S = 1e10
"""Longest time that is used: a parameter may be any float, but no stamp of ROS is later than this."""


@dataclass(frozen=True)
class JointConstraints:
    """Tolerances of one joint; 0 is not checked.

    Attributes:
        trajectory: Largest position error while moving [rad].
        goal: Largest position error at the end [rad].
        max_deceleration_on_cancel: How hard the joint brakes when it is stopped [rad/s²], if joints brake.
    """

    trajectory: float = 0.0
    goal: float = 0.0
    max_deceleration_on_cancel: float = 0.0


@dataclass(frozen=True)
class Constraints:
    """Tolerances of goals that bring none of their own, and how joints are stopped.

    Attributes:
        goal_time: How long after the trajectory's end the goal may still be reached [s]; 0 waits for ever.
        stopped_velocity_tolerance: Largest velocity error at the end [rad/s]. It has no effect: a controller that
            commands positions alone has no velocity error. Clients can still set it.
        decelerate_on_cancel: Whether joints brake when they are stopped, instead of being held where they are. Then
            velocities are measured, and every joint has a deceleration.
        joints: Tolerances of each joint; a joint that is absent is not checked.
    """

    goal_time: float = 0.0
    stopped_velocity_tolerance: float = 0.01
    decelerate_on_cancel: bool = False
    joints: Mapping[str, JointConstraints] = field(default_factory=dict)

    def of(self, joint: str) -> JointConstraints:
        """Return the tolerances of a joint."""
        return self.joints.get(joint, JointConstraints())


@dataclass(frozen=True)
class ControllerParameters:
    """Parameters of a joint trajectory controller that commands positions; an instance is valid.

    Attributes:
        joints: Names of the joints, in the order of every array of the controller.
        allow_partial_joints_goal: Whether a trajectory may leave joints out; they keep their last command.
        allow_integration_in_goal_trajectories: Whether points may lack positions, which are then integrated.
        allow_nonzero_velocity_at_trajectory_end: Whether the last point may have a velocity.
        cmd_timeout: How long after the end of a trajectory the joints are stopped [s]; 0 never. It must be above
            `Constraints.goal_time`, otherwise it does not count.
        constraints: Default tolerances.

    Raises:
        ConfigError: If a number is out of its range.
    """

    joints: tuple[str, ...]
    allow_partial_joints_goal: bool = False
    allow_integration_in_goal_trajectories: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False
    cmd_timeout: float = 0.0
    constraints: Constraints = field(default_factory=Constraints)

    def __post_init__(self) -> None:
        numbers = {
            "cmd_timeout": self.cmd_timeout,
            "constraints.goal_time": self.constraints.goal_time,
            "constraints.stopped_velocity_tolerance": self.constraints.stopped_velocity_tolerance,
        }
        for joint, limits in self.constraints.joints.items():
            numbers |= {f"constraints.{joint}.{key}": value for key, value in vars(limits).items()}
        wrong = {key: value for key, value in numbers.items() if not (math.isfinite(value) and value >= 0)}
        if wrong:
            expected = "must be a finite number of at least 0.0"
            raise ConfigError([Problem(f"{expected}; got {value}", key) for key, value in wrong.items()])

    @property
    def measures_velocity(self) -> bool:
        """Whether velocities are measured."""
        return self.constraints.decelerate_on_cancel

    @property
    def timeout_ns(self) -> int:
        """How long after the end of a trajectory the joints are stopped [ns]; 0 never."""
        return to_nanoseconds(self.cmd_timeout) if self.cmd_timeout > self.constraints.goal_time else 0


def to_nanoseconds(seconds: float) -> int:
    """Convert the time in a parameter to nanoseconds; a time that is too long is cut."""
    return round(min(seconds, _LONGEST_S) * 1e9)
