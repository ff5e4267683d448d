"""Parameters of a joint trajectory controller, with the names and defaults of ros2_controllers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from throwcollect.errors import ConfigError, Problem

_COMMANDS = (("position",), ("position", "velocity"), ("position", "velocity", "acceleration"), ("position", "effort"))
_STATES = (("position",), ("position", "velocity"))
_READ_ONLY = (
    "joints",
    "command_interfaces",
    "state_interfaces",
    "interpolation_method",
    "interpolate_from_desired_state",
    "action_monitor_rate",
    "continuous_joints",
)
_LEAST = {"action_monitor_rate": 0.1}


def least(key: str) -> float:
    """The least value that a parameter with a number may have; it is 0 for almost all."""
    return _LEAST.get(key, 0.0)


@dataclass(frozen=True)
class JointConstraints:
    """Tolerances of one joint; 0 is not checked.

    Attributes:
        trajectory: Largest position error while moving [rad].
        goal: Largest position error at the end [rad].
        max_deceleration_on_cancel: How hard the joint brakes when it is stopped [rad/s²]; 0 cannot brake.
    """

    trajectory: float = 0.0
    goal: float = 0.0
    max_deceleration_on_cancel: float = 0.0


@dataclass(frozen=True)
class Constraints:
    """Tolerances of goals that bring none of their own, and how joints are stopped.

    Attributes:
        goal_time: How long after the trajectory's end the goal may still be reached [s]; 0 waits for ever.
        stopped_velocity_tolerance: Largest velocity error at the end [rad/s]; 0 is not checked. A controller that
            commands positions alone has no velocity error, so that it never takes effect there.
        decelerate_on_cancel: Whether joints brake when they are stopped, instead of being held where they are. Needs
            measured velocities and a deceleration for each joint.
        joints: Tolerances of each joint; a joint that is absent is not checked.
    """

    goal_time: float = 0.0
    stopped_velocity_tolerance: float = 0.01
    decelerate_on_cancel: bool = False
    joints: Mapping[str, JointConstraints] = field(default_factory=dict)

    def of(self, joint: str) -> JointConstraints:
        """Tolerances of a joint."""
        return self.joints.get(joint, JointConstraints())


@dataclass(frozen=True)
class SpeedScaling:
    """How fast the clock of a trajectory goes.

    Attributes:
        initial_scaling_factor: Speed until another one is asked for [-].
    """

    initial_scaling_factor: float = 1.0


@dataclass(frozen=True)
class ControllerParameters:
    """What a position-commanded joint trajectory controller can be set to; an instance is valid.

    Attributes:
        joints: Names of the joints, in the order of every array of the controller.
        command_interfaces: What is commanded: positions; and velocities, velocities and accelerations, or efforts.
        state_interfaces: What is measured: positions, or positions and velocities.
        allow_partial_joints_goal: Whether a trajectory may leave joints out; they keep their last command.
        allow_integration_in_goal_trajectories: Whether points may lack positions, which are then integrated.
        allow_nonzero_velocity_at_trajectory_end: Whether the last point may have a velocity.
        interpolation_method: Splines between points, or none: the next point is commanded at once.
        interpolate_from_desired_state: Whether trajectories begin at the last command instead of the measured state.
        set_last_command_interface_value_as_state_on_activation: Whether activation holds the last command instead of
            the measured position.
        action_monitor_rate: Feedback messages of a goal per simulated second.
        cmd_timeout: How long after the end of a trajectory the joints are stopped [s]; 0 never. It must be above
            `Constraints.goal_time`, otherwise it does not count.
        speed_scaling: How fast the clock of a trajectory goes.
        constraints: Default tolerances.
        continuous_joints: Joints that turn without end, by the robot's description.

    Raises:
        ConfigError: If joints or interfaces are missing, repeated or unknown, or a number is out of its range.
    """

    joints: tuple[str, ...]
    command_interfaces: tuple[str, ...] = ("position",)
    state_interfaces: tuple[str, ...] = ("position",)
    allow_partial_joints_goal: bool = False
    allow_integration_in_goal_trajectories: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False
    interpolation_method: Literal["splines", "none"] = "splines"
    interpolate_from_desired_state: bool = False
    set_last_command_interface_value_as_state_on_activation: bool = True
    action_monitor_rate: float = 20.0
    cmd_timeout: float = 0.0
    speed_scaling: SpeedScaling = SpeedScaling()
    constraints: Constraints = field(default_factory=Constraints)
    continuous_joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        problems = [*self._wrong_choices(), *self._wrong_numbers()]
        if problems:
            raise ConfigError([Problem(message, key) for key, message in problems])

    @classmethod
    def talos(cls, joints: Sequence[str], *, max_deceleration: float | None = None) -> ControllerParameters:
        """Parameters of the controllers of PAL Robotics' Talos.

        Args:
            joints: Names of the controller's joints, in order.
            max_deceleration: How hard joints brake when they are stopped [rad/s²], by measured velocities that Talos
                itself does not have; None holds them where they are, as on Talos.

        Returns:
            The values of talos_controller_configuration (humble-devel 2.0), equal for all limbs.
        """
        brakes = max_deceleration is not None
        limits = JointConstraints(goal=0.02, max_deceleration_on_cancel=max_deceleration or 0.0)
        return cls(
            joints=tuple(joints),
            state_interfaces=("position", "velocity") if brakes else ("position",),
            constraints=Constraints(
                goal_time=0.6,
                stopped_velocity_tolerance=0.05,
                decelerate_on_cancel=brakes,
                joints=dict.fromkeys(joints, limits),
            ),
        )

    @property
    def brakes(self) -> bool:
        """Whether joints brake when they are stopped."""
        decelerations = [self.constraints.of(joint).max_deceleration_on_cancel for joint in self.joints]
        able = "velocity" in self.state_interfaces and min(decelerations) > 0
        return self.constraints.decelerate_on_cancel and able

    @property
    def timeout(self) -> float:
        """How long after the end of a trajectory the joints are stopped [s]; 0 never."""
        return self.cmd_timeout if self.cmd_timeout > self.constraints.goal_time else 0.0

    def warnings(self) -> list[str]:
        """What has been asked for and cannot take effect."""
        warnings = []
        if self.constraints.decelerate_on_cancel and not self.brakes:
            needs = "measured velocities and a max_deceleration_on_cancel above 0 of each joint"
            warnings.append(f"cannot brake without {needs}. Falling back to hold position on cancel.")
        if self.cmd_timeout and not self.timeout:
            values = f"({self.cmd_timeout:g} vs. {self.constraints.goal_time:g})"
            warnings.append(f"Command timeout must be higher than goal_time tolerance {values}; it is off.")
        return warnings

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
        for key, value, allowed in (
            ("command_interfaces", self.command_interfaces, _COMMANDS),
            ("state_interfaces", self.state_interfaces, _STATES),
        ):
            if value not in allowed:
                expected = " or ".join(f"[{', '.join(each)}]" for each in allowed)
                wrong.append((key, f"must be {expected}; got {list(value)}"))
        if self.interpolation_method not in ("splines", "none"):
            wrong.append(("interpolation_method", f"must be splines or none; got {self.interpolation_method!r}"))
        named = [(f"constraints.{joint}", joint) for joint in self.constraints.joints]
        named += [("continuous_joints", joint) for joint in self.continuous_joints]
        wrong += [
            (key, f"unknown joint {joint}; known: {', '.join(self.joints)}")
            for key, joint in named
            if joint not in self.joints
        ]
        return wrong

    def _wrong_numbers(self) -> list[tuple[str, str]]:
        numbers = [
            ("action_monitor_rate", self.action_monitor_rate),
            ("cmd_timeout", self.cmd_timeout),
            ("speed_scaling.initial_scaling_factor", self.speed_scaling.initial_scaling_factor),
            ("constraints.goal_time", self.constraints.goal_time),
            ("constraints.stopped_velocity_tolerance", self.constraints.stopped_velocity_tolerance),
        ]
        for joint, limits in self.constraints.joints.items():
            for key, value in vars(limits).items():
                numbers.append((f"constraints.{joint}.{key}", value))
        return [
            (key, f"must be a finite number of at least {least(key)}; got {value}")
            for key, value in numbers
            if not (math.isfinite(value) and value >= least(key))
        ]
