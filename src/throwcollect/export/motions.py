"""The points of the trajectories that throws were made from, as a file that `task.trajectory` reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from throwcollect.export.exporter import Exporter
from throwcollect.export.readme import Layout, list_joints
from throwcollect.export.throw_source import ExportSource
from throwcollect.robots.description import robot_of
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.sweep.parquet_file import encode_table
from throwcollect.tasks.motion_files import TIME, columns_of
from throwcollect.tasks.motions import Motions

_FILE = "trajectories.parquet"


def describe(source: ExportSource) -> Layout:
    """Say how `write` lays a source out."""
    return Layout(
        files={_FILE: "one row a point: `motion`, the number of the trial; the time; and of each joint that moves."},
        loading=f'import pandas as pd\n\npoints = pd.read_parquet("{_FILE}")',
        notes=(
            f"`task.trajectory: {{family: file, file: {_FILE}}}` makes the same throws again, bit for bit, if the rest "
            "of the configuration is the same.",
        ),
        over_time=[
            "Commanded positions, velocities and accelerations, with quintics between them.",
            list_joints(source),
        ],
    )


def write(source: ExportSource, directory: Path) -> None:
    """Write the points of all throws that have an episode; see `Exporter.write`."""
    robot = robot_of(source.dataset.config)
    names: list[str] = []
    trajectories: list[JointTrajectory] = []
    for throw in source.read(source.throws):
        names.append(str(throw.throw.trial))
        trajectories.append(throw.trajectory)
    joints = trajectories[0].joints
    orders = (
        np.vstack([getattr(each, order) for each in trajectories])
        for order in ("positions", "velocities", "accelerations")
    )
    columns = {TIME: np.concatenate([each.times for each in trajectories])}
    for number, values in enumerate(orders):
        columns |= {columns_of(joint, robot)[number]: column for joint, column in zip(joints, values.T, strict=True)}
    offsets = np.cumsum([0, *(len(each.times) for each in trajectories)])
    (directory / _FILE).write_bytes(encode_table(Motions(tuple(names), joints, offsets, columns).table()))


MOTIONS = Exporter(describe, write)
