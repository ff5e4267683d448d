"""The table of throws: one row a trial, with what was swept, what came of it, and where its episode lies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from throwcollect.dataset.directory import THROWS
from throwcollect.errors import DatasetError
from throwcollect.sweep.parquet_file import read_parquet
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.tasks.throw.outcome import BallState, Outcome, Peak, ThrowResult

REFUSED = "refused"
"""Outcome of a trial that the plan refused; all others are those of `Outcome`."""

Row = dict[str, Any]
"""A row of the table, by column; what is null there is None."""

_NUMBERS = (
    "release_speed_mps",
    "release_elevation_rad",
    "flight_time_s",
    "hit_angle_rad",
    "recontacts",
    "effort_saturated_share",
)
"""Columns that hold a field of `ThrowResult` of the same name."""


@dataclass(frozen=True)
class Place:
    """Where an episode lies.

    Attributes:
        shard: Name of the MCAP file.
        chunk_offset: Where its chunk begins in that file [bytes].
        samples: Number of samples.
        digest: Digest of the episode.
    """

    shard: str
    chunk_offset: int
    samples: int
    digest: str


def _field(name: str, kind: pa.DataType, description: str) -> pa.Field:
    return pa.field(name, kind, metadata={"description": description})


def _number(name: str, description: str) -> pa.Field:
    return _field(name, pa.float64(), description)


def _state_fields(name: str, when: str) -> list[pa.Field]:
    descriptions = [
        f"Time since the start of the trial {when} [s].",
        *(f"Ball centre in world {when}, {axis} [m]." for axis in "xyz"),
        *(f"Velocity of the ball in world {when}, {axis} [m/s]." for axis in "xyz"),
    ]
    return list(map(_number, _state_columns(name), descriptions))


def _peak_fields(name: str, of: str) -> list[pa.Field]:
    return [
        _number(f"{name}_peak_share", f"{of} [-]; 1 is at the limit."),
        _field(f"{name}_peak_joint", pa.string(), f"Joint that had {name}_peak_share."),
    ]


def _result_fields(joints: Sequence[str]) -> list[pa.Field]:
    range_share = "Largest distance of a moving joint from the middle of its range over half the range"
    return [
        *_state_fields("release", "when it left the spoon"),
        *_state_fields("apex", "at the highest point of its flight"),
        *_state_fields("landing", "when it crossed the landing plane"),
        _number("release_speed_mps", "Speed at release [m/s]."),
        _number("release_elevation_rad", "Direction of flight at release above the horizontal [rad]."),
        _number("flight_time_s", "From release to landing [s]."),
        _number("hit_angle_rad", "Direction of flight at landing below the horizontal [rad]."),
        _field("recontacts", pa.int64(), "Contacts with spoon or robot between release and landing."),
        *_peak_fields("position", range_share),
        *_peak_fields("velocity", "Largest speed of a joint over its limit"),
        *_peak_fields("effort", "Largest torque of a joint over its limit"),
        _number("effort_saturated_share", "Share of samples in which some joint's torque is at its limit [-]."),
        *(
            _number(_error_column(joint), f"Largest distance of {joint} from its commanded trajectory [rad].")
            for joint in joints
        ),
    ]


def _result_values(result: ThrowResult, joints: Sequence[str]) -> dict[str, object]:
    """Values of `_result_fields`, by column; what is missing in the result is missing here."""
    values: dict[str, object] = {name: getattr(result, name) for name in _NUMBERS}
    for name, state in (("release", result.release), ("apex", result.apex), ("landing", result.landing)):
        if state is not None:
            numbers = (state.time_s, *state.position, *state.velocity)
            values |= zip(_state_columns(name), numbers, strict=True)
    for name, peak in (
        ("position", result.position_peak),
        ("velocity", result.velocity_peak),
        ("effort", result.effort_peak),
    ):
        if peak is not None:
            values |= {f"{name}_peak_share": peak.share, f"{name}_peak_joint": peak.joint}
    errors = result.tracking_error_rad or {}
    return values | {_error_column(joint): errors.get(joint) for joint in joints}


def ball_state(row: Row, name: str) -> BallState | None:
    """The ball as a row has it; None if the throw came to no such event.

    Args:
        row: A row of the table of throws.
        name: ``release``, ``apex`` or ``landing``.
    """
    time_s, *numbers = (row[column] for column in _state_columns(name))
    return None if time_s is None else BallState(time_s, tuple(numbers[:3]), tuple(numbers[3:]))


def _peak(row: Row, name: str) -> Peak | None:
    joint = row[f"{name}_peak_joint"]
    return None if joint is None else Peak(joint, row[f"{name}_peak_share"])


def _state_columns(name: str) -> list[str]:
    return [
        f"{name}_time_s",
        *(f"{name}_{axis}_m" for axis in "xyz"),
        *(f"{name}_v{axis}_mps" for axis in "xyz"),
    ]


def _error_column(joint: str) -> str:
    return f"{joint}_tracking_error_rad"


class ThrowsTable:
    """Schema of one collection's table; makes rows of results, and results of rows.

    Attributes:
        schema: Columns with their types and descriptions.

    Args:
        parameters: Swept dotted configuration keys, in the order of their columns.
        joints: Joints that the task moves.
    """

    def __init__(self, parameters: Sequence[str], joints: Sequence[str]) -> None:
        self._parameters = tuple(parameters)
        self._joints = tuple(joints)
        fields = _result_fields(joints)
        self._names = [field.name for field in fields]
        self.schema = pa.schema(
            [
                _field("trial", pa.int64(), "Number of the trial."),
                *(_number(key, f"Swept value of {key}.") for key in parameters),
                _field("outcome", pa.string(), f"{', '.join(outcome.value for outcome in Outcome)} or {REFUSED}."),
                _field("reason", pa.string(), "Why the throw did not simply land; null if it did."),
                *fields,
                _field("shard", pa.string(), "MCAP file that holds the episode; null when there is none."),
                _field("chunk_offset", pa.int64(), "Where the episode's chunk begins in that file [bytes]."),
                _field("samples", pa.int64(), "Number of samples of the episode."),
                _field("digest", pa.string(), "SHA-256 of the episode: of its header and its message records."),
            ]
        )

    @classmethod
    def of(cls, plan: Plan) -> ThrowsTable:
        """The table of a plan's trials."""
        return cls(plan.keys, tuple(plan.config.task.end))

    def row(self, trial: Trial, result: ThrowResult, place: Place | None) -> Row:
        """Row of a trial that was run.

        Args:
            trial: The trial.
            result: What came of it.
            place: Where its episode lies; None if there is none.
        """
        values = _result_values(result, self._joints)
        row = self._start_row(trial, result.outcome.value, result.reason)
        row.update((name, values.get(name)) for name in self._names)
        if place is not None:
            row.update(vars(place))
        return row

    def refused_row(self, trial: Trial) -> Row:
        """Row of a trial that the plan refused."""
        return self._start_row(trial, REFUSED, trial.refused)

    def result(self, row: Row) -> ThrowResult:
        """The result that `row` made a row of.

        Args:
            row: The row of a trial that was run.
        """
        errors = {joint: row[_error_column(joint)] for joint in self._joints}
        return ThrowResult(
            outcome=Outcome(row["outcome"]),
            reason=row["reason"],
            release=ball_state(row, "release"),
            apex=ball_state(row, "apex"),
            landing=ball_state(row, "landing"),
            position_peak=_peak(row, "position"),
            velocity_peak=_peak(row, "velocity"),
            effort_peak=_peak(row, "effort"),
            tracking_error_rad=None if None in errors.values() else errors,
            **{name: row[name] for name in _NUMBERS},
        )

    def _start_row(self, trial: Trial, outcome: str, reason: str | None) -> Row:
        values = {key: trial.values[key] for key in self._parameters}
        return {"trial": trial.number, **values, "outcome": outcome, "reason": reason}

    def table(self, rows: Iterable[Row]) -> pa.Table:
        """Rows, in the given order, as an Arrow table; what a row lacks is null."""
        return pa.Table.from_pylist(list(rows), schema=self.schema)


def read_throws_table(path: Path, plan: Plan) -> pa.Table:
    """A table of throws, whatever trials its rows are of.

    Args:
        path: The file.
        plan: Its trials; they say which columns there are.

    Raises:
        DatasetError: If the table is missing or damaged, or has other columns.
    """
    table = read_parquet(path)
    schema = ThrowsTable.of(plan).schema
    if not table.schema.equals(schema):
        wrong = sorted(set(table.schema.names) ^ set(schema.names)) or "types of columns"
        raise DatasetError(f"not the table of this plan: differs in {wrong}", path=path)
    return table


def read_throws(directory: Path, plan: Plan) -> pa.Table:
    """The table of throws of a dataset, whose rows are the trials of its plan in order.

    Raises:
        DatasetError: If the table is missing or damaged, or is not one of this plan.
    """
    path = directory / THROWS
    table = read_throws_table(path, plan)
    if table["trial"].to_pylist() != [trial.number for trial in plan.trials]:
        raise DatasetError(f"its rows are not the {len(plan.trials)} trials of the plan in order", path=path)
    return table
