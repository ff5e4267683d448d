"""Landings of balls, and the releases that they came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.report.outcomes import Outcomes
from throwcollect.report.plotted_points import read_numbers


@dataclass(frozen=True)
class Landings:
    """All throws whose ball crossed the landing plane, of any outcome; each array has the shape ``(n,)``.

    Attributes:
        row: Place of the throw in the table.
        trial: Number of the trial.
        x_m: Ball centre in world [m], forward of the robot.
        y_m: Ball centre in world [m], left of the robot.
        distance_m: Horizontal distance from the robot's base [m].
        hit_angle_rad: Direction of flight below the horizontal [rad].
        speed_mps: Speed at release [m/s].
        elevation_rad: Direction of flight at release above the horizontal [rad].
        code: Outcome, as index into `Outcomes.names`.
    """

    row: NDArray[np.intp]
    trial: NDArray[np.int64]
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    distance_m: NDArray[np.float64]
    hit_angle_rad: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]
    code: NDArray[np.intp]

    @property
    def elevation_deg(self) -> NDArray[np.float64]:
        """Direction of flight at release above the horizontal [°], as figures show it."""
        return np.degrees(self.elevation_rad)

    def __len__(self) -> int:
        return len(self.trial)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Landings:
        return Landings(**{name: column[rows] for name, column in vars(self).items()})


def read_landings(throws: pa.Table, outcomes: Outcomes) -> Landings:
    """Read the landings of a table of throws."""
    x, y = read_numbers(throws, "landing_x_m"), read_numbers(throws, "landing_y_m")
    landings = Landings(
        row=np.arange(len(throws)),
        trial=np.asarray(throws["trial"].to_numpy()),
        x_m=x,
        y_m=y,
        distance_m=np.hypot(x, y),
        hit_angle_rad=read_numbers(throws, "hit_angle_rad"),
        speed_mps=read_numbers(throws, "release_speed_mps"),
        elevation_rad=read_numbers(throws, "release_elevation_rad"),
        code=outcomes.codes,
    )
    return landings[np.isfinite(x + y)]
