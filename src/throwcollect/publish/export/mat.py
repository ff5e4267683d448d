"""MATLAB files in the structure of the throwing database of the Jožef Stefan Institute.

The structure is ``robot_throws`` of github.com/abr-ijs/Throwing-trajectories-dataset: cells ``qPath`` and ``DMP``, the
matrix ``targets`` and the structure ``robot_data``, with fields of the same names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import DynamicMovementPrimitive
from throwcollect.config.task_config import TaskConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError, refuse_argument
from throwcollect.extras import lazily
from throwcollect.progress_log import log_progress
from throwcollect.publish.export.exporter import Exporter, Layout, list_joints
from throwcollect.publish.export.npz import to_array
from throwcollect.publish.export.throw_source import ExportSource, ThrowSeries, read_metadata
from throwcollect.robots.trajectory import JointTrajectory, sample_quintic
from throwcollect.tasks.dmp import FIT_POINTS, fit_motions, kernels, roll_out

scipy_io = lazily("scipy.io")

BASIS_FUNCTIONS = 25
"""Number of basis functions of each joint in a fitted DMP."""


def describe(source: ExportSource) -> Layout:
    """Describe how `write` lays a source out."""
    return Layout(
        files={
            "throws.mat": "`throws` has one field a column of the table of all trials, with NaN, -1 or an empty string "
            "where there is nothing. `units` has the unit of each of these fields.",
            "trajectories/": "one file a recording, with the structure `robot_throws`; its k-th throw is trial "
            "`robot_throws.trial(k)`.",
        },
        loading=f"""\
load('trajectories/{next(iter(source.shards))}.mat');
k = 1;
path = robot_throws.qPath{{k}};
dmp = robot_throws.DMP{{k}};
target = robot_throws.targets(k, :);  % d, h, alpha""",
        over_time=[*_FIELDS, "", list_joints(source)],
        language="matlab",
    )


_FIELDS = (
    "Fields of `robot_throws`, with n for the number of joints that move. `qPath`, `targets`, `DMP` and `robot_data` "
    "are those of the throwing database of the Jožef Stefan Institute.",
    "",
    "- `robot_data`: `joints`; `base`, position of the robot's base in world [m]; `dt`, time step [s]. There are no "
    "link lengths, which describe planar arms alone.",
    "- `qPath{k}`: commanded motion, a row each `dt`: time [s], n positions [rad], n velocities [rad/s], n "
    "accelerations [rad/s²].",
    "- `targets(k, :)`: what the throw achieved. `d`: distance of the ball's centre at its landing from the vertical "
    "axis through the world's origin [m]; `h`: height of the landing plane [m]; `alpha`: direction of flight at the "
    "landing below the horizontal [rad]. `d` and `alpha` are NaN if the ball did not land.",
    "- `wanted(k, :)`: where the throw should have ended, in columns that `wanted_names` names; only if all throws "
    "have a target.",
    "- `DMP{k}`: `N`, `dt`, `a_z`, `a_x`, `c`, `sigma_2`, `w` (N × n), `tau`, `goal`, `y0`, with which each joint y "
    "follows `tau z' = a_z (a_z / 4 (goal - y) - z) + f(x)`, `tau y' = z`, `tau x' = -a_x x`, "
    "`f(x) = sum(psi_i w_i) / sum(psi_i) x`, `psi_i = exp(-(x - c_i)² / (2 sigma_2_i))`, x(0) = 1. `fitted` is 0 if "
    f"the throw was made from these parameters, and 1 if they were fitted to `qPath` by linear regression over "
    f"{BASIS_FUNCTIONS} basis functions. `error`: largest distance of each joint from `qPath` when it follows them "
    "[rad].",
    "- `trial(k)`: number of the trial.",
    "- `measured{k}`: time [s], n positions [rad], n velocities [rad/s] and n torques [N m] of the joints that move.",
    "- `ball{k}`: time [s], x, y, z [m] and vx, vy, vz [m/s] of the ball's centre in world.",
)


def write(source: ExportSource, directory: Path) -> None:
    """Write a dataset as MATLAB files of version 5; see `Exporter.write`."""
    task = source.dataset.config.task
    if "landing" not in task.events:
        raise refuse_argument(
            "to",
            f"mat has the structure of a throwing database, and the task {task.name} throws no ball",
            expected="another format",
        )
    # An array of objects, as strings are, becomes a cell array; one of strings would become a matrix of characters.
    columns = {name: to_array(source.table[name])[:, np.newaxis] for name in source.table.column_names}
    units = {field.name: read_metadata(field).get("unit", "") for field in source.table.schema}
    _save(directory / "throws.mat", {"throws": columns, "units": units, "digest_of_dataset": source.dataset.digest})
    (directory / "trajectories").mkdir()
    for shard, throws in source.shards.items():
        recording = {"robot_throws": _gather_throws(source, throws), "digest_of_dataset": source.dataset.digest}
        _save(directory / "trajectories" / f"{shard}.mat", recording)


def _save(path: Path, variables: Mapping[str, Any]) -> None:
    try:
        scipy_io.savemat(path, variables, do_compression=True, long_field_names=True)
    except (scipy_io.matlab.MatWriteError, ValueError) as error:
        # A variable has at most 4 GiB, and the name of a column at most 63 characters.
        raise DatasetError(f"{path.name}: {error}", hint="export at a lower rate, or another format") from error


def _make_cell(values: Sequence[Any]) -> NDArray[np.object_]:
    cell = np.empty((1, len(values)), dtype=object)
    # NumPy would make a matrix of arrays with equal shapes, if it were given all of them at once.
    for index, value in enumerate(values):
        cell[0, index] = value
    return cell


def _gather_throws(source: ExportSource, throws: Dataset) -> dict[str, Any]:
    moving = [source.dataset.joints.index(joint) for joint in source.dataset.moving_joints]
    paths, motions, targets, measured, balls = [], [], [], [], []
    for throw in source.read(throws):
        config = throw.throw.config
        # The last time is the first one at which the motion is over.
        times = np.arange(int(np.ceil(throw.trajectory.times[-1] * source.rate_hz - 1e-9)) + 1) / source.rate_hz
        paths.append(np.column_stack([times, *sample_quintic(throw.trajectory, times)]))
        motions.append((throw.trajectory, config.task))
        landing = (throw.throw["landing_x_m"], throw.throw["landing_y_m"], throw.throw["hit_angle_rad"])
        x, y, angle = (np.nan if value is None else value for value in landing)
        targets.append((float(np.hypot(x, y)), config.scene.landing_height_m, angle))
        measured.append(
            _stack_signals(throw, "joint_position_rad", "joint_velocity_radps", "joint_effort_nm", of=moving)
        )
        balls.append(_stack_signals(throw, "ball_position_m", "ball_velocity_mps", of=[0, 1, 2]))
    wanted: dict[str, Any] = {}
    if names := [each.name for each in source.targets]:
        wanted = {"wanted": np.column_stack([throws[name] for name in names]), "wanted_names": _make_cell(names)}
    return {
        "robot_data": {
            "joints": _make_cell(source.dataset.moving_joints),
            "base": np.array([[0.0, 0.0, source.dataset.config.robot.base_height_m]]),
            "dt": 1 / source.rate_hz,
        },
        "qPath": _make_cell(paths),
        "targets": np.array(targets),
        **wanted,
        "DMP": _make_cell([*_describe_primitives(motions, source.rate_hz)]),
        "trial": throws["trial"].astype(np.float64)[:, np.newaxis],
        "measured": _make_cell(measured),
        "ball": _make_cell(balls),
    }


def _stack_signals(throw: ThrowSeries, *names: str, of: Sequence[int]) -> NDArray[np.float64]:
    return np.column_stack([throw.signals["time_s"], *(throw.signals[name][:, of] for name in names)])


def _describe_primitives(
    motions: Sequence[tuple[JointTrajectory, TaskConfig]], rate_hz: int
) -> Iterator[dict[str, Any]]:
    """Describe the DMPs of throws: those of their configurations, else ones fitted to the commanded motions."""
    to_fit = [motion for motion, task in motions if not isinstance(task.trajectory, DynamicMovementPrimitive)]
    fitted = iter(fit_motions(to_fit, basis_functions=BASIS_FUNCTIONS))
    # Rolling them out takes three times as long as reading the throws.
    for trajectory, task in log_progress(motions, len(motions), "motion", "described"):
        own = task.trajectory if isinstance(task.trajectory, DynamicMovementPrimitive) else None
        family, tau = (own, task.duration_s) if own is not None else (next(fitted), float(trajectory.times[-1]))
        times = np.linspace(0, trajectory.times[-1], FIT_POINTS)
        positions, _, _ = sample_quintic(trajectory, times)
        weights = np.array(
            [family.weights.get(joint, [0.0] * family.basis_functions) for joint in trajectory.joints], dtype=np.float64
        )
        start, goal = trajectory.positions[0], trajectory.positions[-1]
        motion = roll_out(times, start=start, goal=goal, weights=weights, tau=tau, family=family)[0]
        centres, variances = kernels(count=family.basis_functions, alpha_x=family.alpha_x)
        yield {
            "N": float(family.basis_functions),
            "dt": 1 / rate_hz,
            "a_z": family.alpha_z,
            "a_x": family.alpha_x,
            "c": centres[np.newaxis],
            "sigma_2": variances[np.newaxis],
            "w": weights.T,
            "tau": tau,
            "goal": goal[np.newaxis],
            "y0": start[np.newaxis],
            "fitted": float(own is None),
            "error": np.abs(motion - positions).max(axis=0)[np.newaxis],
        }


MAT = Exporter(describe, write, packages=("scipy",))
