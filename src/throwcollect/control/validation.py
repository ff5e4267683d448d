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


def find_refusal(trajectory: Trajectory, parameters: ControllerParameters, now_ns: int) -> TrajectoryRefusal | None:
    """Find the first rule that a trajectory breaks at the present time [ns]; None if it can be executed."""
    for check in (_check_joints, _check_numbers, _check_times):
        for code, text in check(trajectory, parameters, now_ns):
            return TrajectoryRefusal(code, text)
    return None


# Each rule may rely on those before it, as only the first that is broken counts.
_Broken = Iterator[tuple[ErrorCode, str]]


def _check_joints(trajectory: Trajectory, parameters: ControllerParameters, _now_ns: int) -> _Broken:
    names, joints = trajectory.joint_names, parameters.joints
    if not parameters.allow_partial_joints_goal and len(names) != len(joints):
        counts = f"expected all {len(joints)} of {_join(joints)}; got {len(names)}: {_join(names)}"
        yield ErrorCode.INVALID_JOINTS, f"Joints on incoming trajectory don't match the controller joints. ({counts})"
    if not names:
        text = f"Empty joint names on incoming trajectory. (expected some of {_join(joints)})"
        yield ErrorCode.INVALID_JOINTS, text
    if not len(trajectory.times_ns):
        yield ErrorCode.INVALID_GOAL, "Empty trajectory received. (expected at least 1 point; got 0)"
    for name in names:
        if name not in joints:
            text = f"Incoming joint {name} doesn't match the controller's joints. (expected {_join(joints)})"
            yield ErrorCode.INVALID_JOINTS, text
    for index, name in enumerate(names):
        if name in names[:index]:
            text = f"Joint {name} is named more than once on incoming trajectory. (got {_join(names)})"
            yield ErrorCode.INVALID_JOINTS, text


def _check_numbers(trajectory: Trajectory, parameters: ControllerParameters, _now_ns: int) -> _Broken:
    expected, integrates = len(trajectory.joint_names), parameters.allow_integration_in_goal_trajectories
    all_sizes = [list(map(len, getattr(trajectory, field))) for field in _FIELDS]
    for index, sizes in enumerate(zip(*all_sizes, strict=True)):
        if integrates and not any(sizes):
            text = f"The given trajectory has no position, velocity, or acceleration points. (point #{index})"
            yield ErrorCode.INVALID_GOAL, text
        for field, size in zip(_FIELDS, sizes, strict=True):
            if size != expected and (size or (field == "positions" and not integrates)):
                text = f"Mismatch between joint_names size ({expected}) and {field} ({size}) at point #{index}."
                yield ErrorCode.INVALID_GOAL, text
    for field, word in _FIELDS.items():
        rows: Rows = getattr(trajectory, field)
        present = [index for index, values in enumerate(rows) if len(values)]
        # Their sizes have been checked, so these rows make a table.
        table = np.array(rows if len(present) == len(rows) else [rows[index] for index in present], dtype=np.float64)
        if not np.isfinite(table).all():
            row, column = np.argwhere(~np.isfinite(table))[0]
            where = f"{word} of joint {trajectory.joint_names[column]} at point #{present[row]}"
            yield ErrorCode.INVALID_GOAL, f"{where} is not finite: {table[row, column]}"
    if not parameters.allow_nonzero_velocity_at_trajectory_end:
        for joint, velocity in zip(trajectory.joint_names, trajectory.velocities[-1], strict=False):
            if abs(velocity) > END_VELOCITY_LIMIT:
                text = f"Velocity of last trajectory point of joint {joint} is not zero: {velocity:.15f}"
                yield ErrorCode.INVALID_GOAL, f"{text} (limit {END_VELOCITY_LIMIT:.3g} rad/s)"


def _check_times(trajectory: Trajectory, _parameters: ControllerParameters, now_ns: int) -> _Broken:
    times_ns = trajectory.times_ns
    if trajectory.stamp_ns and (end_ns := trajectory.stamp_ns + times_ns[-1]) < now_ns:
        times = f"non-zero start time ({trajectory.stamp_ns / 1e9:f}) that ends in the past ({end_ns / 1e9:f})"
        text = f"Received trajectory with {times} (expected an end at {now_ns / 1e9:f} or later)"
        yield ErrorCode.OLD_HEADER_TIMESTAMP, text
    if times_ns[0] < 0:
        text = f"Time of point 0 is negative, it is {times_ns[0] / 1e9:f} (expected 0 or more)"
        yield ErrorCode.INVALID_GOAL, text
    for index in range(1, len(times_ns)):
        if times_ns[index] <= times_ns[index - 1]:
            values = f"it is {times_ns[index - 1] / 1e9:f} and {times_ns[index] / 1e9:f} respectively"
            text = f"Time between points {index - 1} and {index} is not strictly increasing, {values}"
            yield ErrorCode.INVALID_GOAL, text
    for index, row in enumerate(trajectory.effort):
        if len(row):
            rule = "Trajectories with effort fields are only supported for controllers using the 'effort' command"
            text = f"{rule} interface. (expected none; got {len(row)} values at point #{index})"
            yield ErrorCode.INVALID_GOAL, text


def _join(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"
