"""Parameters of a joint trajectory controller, with the names and defaults of ros2_controllers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from throwcollect.errors import ConfigError, Problem

_READ_ONLY = ("joints", "command_interfaces", "state_interfaces", "interpolation_method")


@dataclass(frozen=True)
class JointConstraints:
    """Tolerances of one joint; 0 is not checked.

    Attributes:
        trajectory: Largest position error while moving [rad].
        goal: Largest position error at the end [rad].
    """

    trajectory: float = 0.0
    goal: float = 0.0


@dataclass(frozen=True)
class Constraints:
    """Tolerances of goals that bring none of their own.

    Attributes:
        goal_time: How long after the trajectory's end the goal may still be reached [s]; 0 waits for ever.
        stopped_velocity_tolerance: Largest velocity error at the end [rad/s]. A controller that commands positions
            alone has no velocity error, so it never takes effect here, as upstream.
        joints: Tolerances of each joint; a joint that is absent is not checked.
    """

    goal_time: float = 0.0
    stopped_velocity_tolerance: float = 0.01
    joints: Mapping[str, JointConstraints] = field(default_factory=dict)


@dataclass(frozen=True)
class ControllerParameters:
    """What a position-commanded joint trajectory controller can be set to; an instance is valid.

    Attributes:
        joints: Names of the joints, in the order of every array of the controller.
        command_interfaces: What is commanded: positions.
        state_interfaces: What is measured: positions, or positions and velocities.
        allow_partial_joints_goal: Whether a trajectory may leave joints out; they keep their last command.
        allow_nonzero_velocity_at_trajectory_end: Whether the last point may have a velocity.
        interpolation_method: Splines between points, or none: the next point is commanded at once.
        set_last_command_interface_value_as_state_on_activation: Whether activation holds the last command instead of
            the measured position.
        action_monitor_rate: Feedback messages of a goal per simulated second.
        constraints: Default tolerances.

    Raises:
        ConfigError: If joints or interfaces are missing, repeated or unknown, or a number is out of its range.
    """

    joints: tuple[str, ...]
    command_interfaces: tuple[str, ...] = ("position",)
    state_interfaces: tuple[str, ...] = ("position",)
    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False
    interpolation_method: Literal["splines", "none"] = "splines"
    set_last_command_interface_value_as_state_on_activation: bool = True
    action_monitor_rate: float = 20.0
    constraints: Constraints = field(default_factory=Constraints)

    def __post_init__(self) -> None:
        problems = [*self._wrong_choices(), *self._wrong_numbers()]
        if problems:
            raise ConfigError([Problem(message, key) for key, message in problems])

    @classmethod
    def talos(cls, joints: Sequence[str]) -> ControllerParameters:
        """Parameters of the controllers of PAL Robotics' Talos.

        Args:
            joints: Names of the controller's joints, in order.

        Returns:
            The values of talos_controller_configuration (humble-devel 2.0), equal for all limbs.
        """
        return cls(
            joints=tuple(joints),
            constraints=Constraints(
                goal_time=0.6,
                stopped_velocity_tolerance=0.05,
                joints={joint: JointConstraints(goal=0.02) for joint in joints},
            ),
        )

    def check_change(self, new: ControllerParameters, controller: str) -> None:
        """Make sure that a running controller may be set to other parameters.

        Args:
            new: The parameters to be.
            controller: Its name, for the error.

        Raises:
            ValueError: If a parameter differs that is fixed when the controller is made.
        """
        for key in _READ_ONLY:
            if getattr(new, key) != getattr(self, key):
                raise ValueError(f"{controller}: parameter {key} is read-only")

    def _wrong_choices(self) -> list[tuple[str, str]]:
        wrong = []
        if not self.joints or len(set(self.joints)) < len(self.joints):
            wrong.append(("joints", f"must be different names, at least one; got {list(self.joints)}"))
        if self.command_interfaces != ("position",):
            wrong.append(("command_interfaces", f"must be [position]; got {list(self.command_interfaces)}"))
        if self.state_interfaces not in (("position",), ("position", "velocity")):
            expected = "[position] or [position, velocity]"
            wrong.append(("state_interfaces", f"must be {expected}; got {list(self.state_interfaces)}"))
        if self.interpolation_method not in ("splines", "none"):
            wrong.append(("interpolation_method", f"must be splines or none; got {self.interpolation_method!r}"))
        unknown = [joint for joint in self.constraints.joints if joint not in self.joints]
        wrong += [(f"constraints.{joint}", f"unknown joint; known: {', '.join(self.joints)}") for joint in unknown]
        return wrong

    def _wrong_numbers(self) -> list[tuple[str, str]]:
        numbers = [
            ("action_monitor_rate", self.action_monitor_rate, 0.1),
            ("constraints.goal_time", self.constraints.goal_time, 0.0),
            ("constraints.stopped_velocity_tolerance", self.constraints.stopped_velocity_tolerance, 0.0),
        ]
        for joint, limits in self.constraints.joints.items():
            numbers.append((f"constraints.{joint}.trajectory", limits.trajectory, 0.0))
            numbers.append((f"constraints.{joint}.goal", limits.goal, 0.0))
        return [
            (key, f"must be a finite number of at least {lowest}; got {value}")
            for key, value, lowest in numbers
            if not (math.isfinite(value) and value >= lowest)
        ]
