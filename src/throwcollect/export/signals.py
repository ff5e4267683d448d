"""Quantities of a throw over time, and the unit of every column: one description for all formats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from throwcollect.config.task_config import TargetColumn
from throwcollect.dataset.trajectory_columns import name_components
from throwcollect.units import ascii_unit, unit_of_name


def unit_of(column: str) -> str:
    """Find the unit of a column of numbers in ASCII, such as ``m/s^2``; ``1`` for counts and shares."""
    return ascii_unit(unit_of_name(column))


@dataclass(frozen=True)
class Signal:
    """One quantity over time.

    Attributes:
        name: Name of the array ``(n_samples, n_components)``, or ``(n_samples,)`` without components.
        description: One sentence.
        components: Name of each component as a column of its own; empty for a scalar.
        each: Its components in words.
        pattern: Names of their columns in short.
    """

    name: str
    description: str
    components: tuple[str, ...] = ()
    each: str = ""
    pattern: str = ""

    @property
    def unit(self) -> str:
        """Unit of all its components."""
        return unit_of(self.name)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one sample."""
        return (len(self.components),) if self.components else ()

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in a table."""
        return self.components or (self.name,)


def list_signals(joints: Sequence[str], moving: Sequence[str], targets: Sequence[TargetColumn]) -> tuple[Signal, ...]:
    """Describe all signals of an exported throw; those of targets have the same value in all its samples."""
    every = f"{len(joints)} joints"
    return (
        Signal("time_s", "Time since the start of the trial.", pattern="time_s"),
        _describe_joints("joint_position_rad", "Measured joint positions.", joints, every),
        _describe_joints("joint_velocity_radps", "Measured joint velocities.", joints, every),
        _describe_joints("joint_effort_nm", "Torques of the motors; 0 for locked joints.", joints, every),
        _describe_joints(
            "command_position_rad", "Commanded positions, on the trajectory that controllers were sent.", moving
        ),
        _describe_joints("command_velocity_radps", "Commanded velocities.", moving),
        _describe_joints("command_acceleration_radps2", "Commanded accelerations.", moving),
        _describe_ball("ball_position_m", "Ball centre in world.", "ball_position", "xyz"),
        _describe_ball("ball_orientation_xyzw", "Unit quaternion, ball to world.", "ball_orientation_xyzw", "xyzw"),
        _describe_ball("ball_velocity_mps", "Velocity of the ball in world.", "ball_velocity", "xyz"),
        _describe_ball(
            "ball_angular_velocity_radps", "Angular velocity of the ball in world.", "ball_angular_velocity", "xyz"
        ),
        *(Signal(each.name, each.description, (each.name,), "target", each.name) for each in targets),
    )


def _describe_joints(name: str, description: str, joints: Sequence[str], each: str = "moving joints") -> Signal:
    ending = name.removeprefix("joint_")
    return Signal(name, description, tuple(f"{joint}_{ending}" for joint in joints), each, f"<joint>_{ending}")


def _describe_ball(name: str, description: str, column: str, axes: str) -> Signal:
    components = name_components(column, ())
    return Signal(name, description, components, ", ".join(axes), ", ".join(components))
