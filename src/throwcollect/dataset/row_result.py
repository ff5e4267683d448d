"""What came of a trial, from its row in the table of throws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from throwcollect.tasks.throw import BallState, Outcome, Peak, ThrowResult

_NUMBERS = (
    "release_speed_mps",
    "release_elevation_rad",
    "flight_time_s",
    "hit_angle_rad",
    "recontacts",
    "effort_saturated_share",
)


def row_result(row: Mapping[str, Any], joints: Sequence[str]) -> ThrowResult:
    """The result that `ThrowsTable.row` made the row of.

    Args:
        row: A row of a trial that has an episode.
        joints: Joints that the task moves.
    """
    errors = {joint: row[f"{joint}_tracking_error_rad"] for joint in joints}
    return ThrowResult(
        outcome=Outcome(row["outcome"]),
        reason=row["reason"],
        release=_state(row, "release"),
        apex=_state(row, "apex"),
        landing=_state(row, "landing"),
        position_peak=_peak(row, "position"),
        velocity_peak=_peak(row, "velocity"),
        effort_peak=_peak(row, "effort"),
        tracking_error_rad=None if None in errors.values() else errors,
        **{name: row[name] for name in _NUMBERS},
    )


def _state(row: Mapping[str, Any], name: str) -> BallState | None:
    if row[f"{name}_time_s"] is None:
        return None
    position, velocity = (
        (row[f"{name}_{x}"], row[f"{name}_{y}"], row[f"{name}_{z}"])
        for x, y, z in (("x_m", "y_m", "z_m"), ("vx_mps", "vy_mps", "vz_mps"))
    )
    return BallState(row[f"{name}_time_s"], position, velocity)


def _peak(row: Mapping[str, Any], name: str) -> Peak | None:
    joint = row[f"{name}_peak_joint"]
    return None if joint is None else Peak(joint, row[f"{name}_peak_share"])
