"""Which trajectories a controller refuses, and why.

The rules and their texts are those of ros2_controllers (Jazzy, 4.42), which clients know; each text goes on with the
value and the limit. Stricter than upstream: sizes are checked before contents, and repeated joints, numbers that are
not finite and a negative first time are refused, as upstream would command nonsense or crash.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from throwcollect.control.parameters import ControllerParameters
from throwcollect.control.values import ErrorCode, Rows, Trajectory, TrajectoryRefusal

END_VELOCITY_LIMIT = float(np.finfo(np.float32).eps)
"""Largest magnitude of a last point's velocity that counts as zero [rad/s] (ros2_controllers)."""


_FIELDS = {"positions": "Position", "velocities": "Velocity", "accelerations": "Acceleration"}
"""Fields of a point that are commanded, with the word for one value of each."""


def refusal(trajectory: Trajectory, parameters: ControllerParameters, now_ns: int) -> TrajectoryRefusal | None:
    """Find the first rule that a trajectory breaks at the present time [ns]; None if it can be executed."""
    answers = _judge(trajectory, parameters, now_ns)
    return next((TrajectoryRefusal(code, text) for code, text in answers if text is not None), None)


def _judge(
    trajectory: Trajectory, parameters: ControllerParameters, now_ns: int
) -> Iterator[tuple[ErrorCode, str | None]]:
    """Check one rule after the other; each may rely on those before it."""
    yield ErrorCode.INVALID_JOINTS, _too_few_joints(trajectory, parameters)
    yield ErrorCode.INVALID_GOAL, _no_points(trajectory)
    yield ErrorCode.INVALID_JOINTS, _wrong_joints(trajectory, parameters)
    yield ErrorCode.INVALID_GOAL, _wrong_sizes(trajectory, parameters)
    yield ErrorCode.INVALID_GOAL, _not_finite(trajectory)
    yield ErrorCode.INVALID_GOAL, _moving_end(trajectory, parameters)
    yield ErrorCode.OLD_HEADER_TIMESTAMP, _over_already(trajectory, now_ns)
    yield ErrorCode.INVALID_GOAL, _wrong_times(trajectory)
    yield ErrorCode.INVALID_GOAL, _effort(trajectory)


def _too_few_joints(trajectory: Trajectory, parameters: ControllerParameters) -> str | None:
    names, joints = trajectory.joint_names, parameters.joints
    if not parameters.allow_partial_joints_goal and len(names) != len(joints):
        counts = f"expected all {len(joints)} of {_join(joints)}; got {len(names)}: {_join(names)}"
        return f"Joints on incoming trajectory don't match the controller joints. ({counts})"
    if not len(names):
        return f"Empty joint names on incoming trajectory. (expected some of {_join(joints)})"
    return None


def _no_points(trajectory: Trajectory) -> str | None:
    return None if len(trajectory.times_ns) else "Empty trajectory received. (expected at least 1 point; got 0)"


def _wrong_joints(trajectory: Trajectory, parameters: ControllerParameters) -> str | None:
    names, joints = trajectory.joint_names, parameters.joints
    for name in names:
        if name not in joints:
            return f"Incoming joint {name} doesn't match the controller's joints. (expected {_join(joints)})"
    for index, name in enumerate(names):
        if name in names[:index]:
            return f"Joint {name} is named more than once on incoming trajectory. (got {_join(names)})"
    return None


def _wrong_sizes(trajectory: Trajectory, parameters: ControllerParameters) -> str | None:
    expected = len(trajectory.joint_names)
    integrates = parameters.allow_integration_in_goal_trajectories
    all_sizes = [list(map(len, getattr(trajectory, field))) for field in _FIELDS]
    for index, sizes in enumerate(zip(*all_sizes, strict=True)):
        if integrates and not any(sizes):
            return f"The given trajectory has no position, velocity, or acceleration points. (point #{index})"
        for field, size in zip(_FIELDS, sizes, strict=True):
            if size != expected and (size or (field == "positions" and not integrates)):
                return f"Mismatch between joint_names size ({expected}) and {field} ({size}) at point #{index}."
    return None


def _not_finite(trajectory: Trajectory) -> str | None:
    for field, word in _FIELDS.items():
        rows: Rows = getattr(trajectory, field)
        present = [index for index, values in enumerate(rows) if len(values)]
        # Their sizes have been checked, so these rows make a table.
        table = np.array(rows if len(present) == len(rows) else [rows[index] for index in present], dtype=np.float64)
        if not np.isfinite(table).all():
            row, column = np.argwhere(~np.isfinite(table))[0]
            where = f"{word} of joint {trajectory.joint_names[column]} at point #{present[row]}"
            return f"{where} is not finite: {table[row, column]}"
    return None


def _moving_end(trajectory: Trajectory, parameters: ControllerParameters) -> str | None:
    if parameters.allow_nonzero_velocity_at_trajectory_end:
        return None
    for joint, velocity in zip(trajectory.joint_names, trajectory.velocities[-1], strict=False):
        if abs(velocity) > END_VELOCITY_LIMIT:
            text = f"Velocity of last trajectory point of joint {joint} is not zero: {velocity:.15f}"
            return f"{text} (limit {END_VELOCITY_LIMIT:.3g} rad/s)"
    return None


def _over_already(trajectory: Trajectory, now_ns: int) -> str | None:
    if not trajectory.stamp_ns:
        return None
    end_ns = trajectory.stamp_ns + trajectory.times_ns[-1]
    if end_ns >= now_ns:
        return None
    times = f"non-zero start time ({trajectory.stamp_ns / 1e9:f}) that ends in the past ({end_ns / 1e9:f})"
    return f"Received trajectory with {times} (expected an end at {now_ns / 1e9:f} or later)"


def _wrong_times(trajectory: Trajectory) -> str | None:
    times_ns = trajectory.times_ns
    if times_ns[0] < 0:
        return f"Time of point 0 is negative, it is {times_ns[0] / 1e9:f} (expected 0 or more)"
    for index in range(1, len(times_ns)):
        if times_ns[index] <= times_ns[index - 1]:
            values = f"it is {times_ns[index - 1] / 1e9:f} and {times_ns[index] / 1e9:f} respectively"
            return f"Time between points {index - 1} and {index} is not strictly increasing, {values}"
    return None


def _effort(trajectory: Trajectory) -> str | None:
    for index, values in enumerate(trajectory.effort):
        if len(values):
            rule = "Trajectories with effort fields are only supported for controllers using the 'effort' command"
            return f"{rule} interface. (expected none; got {len(values)} values at point #{index})"
    return None


def _join(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
