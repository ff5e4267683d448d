"""The table of throws: one row a trial, with what was swept, what came of it, and where its episode lies."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from throwcollect.tasks.throw import BallState, Outcome, Peak, ThrowResult

REFUSED = "refused"
"""Outcome of a trial that the plan refused; all others are those of `Outcome`."""

Row = dict[str, Any]


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


@dataclass(frozen=True)
class _Column:
    name: str
    type: pa.DataType
    description: str
    read: Callable[[ThrowResult], object]


def _component(read: Callable[[ThrowResult], BallState | None], axis: int, *, velocity: bool) -> Callable[..., object]:
    def component(result: ThrowResult) -> float | None:
        state = read(result)
        if state is None:
            return None
        return (state.velocity if velocity else state.position)[axis]

    return component


def _state_columns(name: str, when: str, read: Callable[[ThrowResult], BallState | None]) -> list[_Column]:
    def time(result: ThrowResult) -> float | None:
        state = read(result)
        return None if state is None else state.time_s

    columns = [_Column(f"{name}_time_s", pa.float64(), f"Time since the start of the trial {when} [s].", time)]
    for axis, letter in enumerate("xyz"):
        text = f"Ball centre in world {when}, {letter} [m]."
        columns.append(_Column(f"{name}_{letter}_m", pa.float64(), text, _component(read, axis, velocity=False)))
    for axis, letter in enumerate("xyz"):
        text = f"Velocity of the ball in world {when}, {letter} [m/s]."
        columns.append(_Column(f"{name}_v{letter}_mps", pa.float64(), text, _component(read, axis, velocity=True)))
    return columns


def _peak_columns(name: str, of: str, read: Callable[[ThrowResult], Peak | None]) -> list[_Column]:
    def share(result: ThrowResult) -> float | None:
        peak = read(result)
        return None if peak is None else peak.share

    def joint(result: ThrowResult) -> str | None:
        peak = read(result)
        return None if peak is None else peak.joint

    return [
        _Column(f"{name}_peak_share", pa.float64(), f"{of} [-]; 1 is at the limit.", share),
        _Column(f"{name}_peak_joint", pa.string(), f"Joint that had {name}_peak_share.", joint),
    ]


def _result_columns(joints: Sequence[str]) -> list[_Column]:
    number = pa.float64()
    return [
        *_state_columns("release", "when it left the spoon", lambda result: result.release),
        *_state_columns("apex", "at the highest point of its flight", lambda result: result.apex),
        *_state_columns("landing", "when it crossed the landing plane", lambda result: result.landing),
        _Column("release_speed_mps", number, "Speed at release [m/s].", lambda result: result.release_speed_mps),
        _Column(
            "release_elevation_rad",
            number,
            "Direction of flight at release above the horizontal [rad].",
            lambda result: result.release_elevation_rad,
        ),
        _Column("flight_time_s", number, "From release to landing [s].", lambda result: result.flight_time_s),
        _Column(
            "hit_angle_rad",
            number,
            "Direction of flight at landing below the horizontal [rad].",
            lambda result: result.hit_angle_rad,
        ),
        _Column(
            "recontacts",
            pa.int64(),
            "Contacts with spoon or robot between release and landing.",
            lambda result: result.recontacts,
        ),
        *_peak_columns(
            "position",
            "Largest distance of a moving joint from the middle of its range over half the range",
            lambda result: result.position_peak,
        ),
        *_peak_columns("velocity", "Largest speed of a joint over its limit", lambda result: result.velocity_peak),
        *_peak_columns("effort", "Largest torque of a joint over its limit", lambda result: result.effort_peak),
        _Column(
            "effort_saturated_share",
            number,
            "Share of samples in which some joint's torque is at its limit [-].",
            lambda result: result.effort_saturated_share,
        ),
        *(_tracking_column(joint) for joint in joints),
    ]


def _tracking_column(joint: str) -> _Column:
    def error(result: ThrowResult) -> float | None:
        return None if result.tracking_error_rad is None else result.tracking_error_rad.get(joint)

    text = f"Largest distance of {joint} from its commanded trajectory [rad]."
    return _Column(f"{joint}_tracking_error_rad", pa.float64(), text, error)


class ThrowsTable:
    """Makes the rows and the schema of one collection's table.

    Attributes:
        schema: Columns with their types and descriptions.

    Args:
        parameters: Swept dotted configuration keys, in the order of their columns.
        joints: Joints that the task moves.
    """

    def __init__(self, parameters: Sequence[str], joints: Sequence[str]) -> None:
        self._parameters = tuple(parameters)
        self._columns = _result_columns(joints)
        self.schema = pa.schema(
            [
                _field("trial", pa.int64(), "Number of the trial."),
                *(_field(key, pa.float64(), f"Swept value of {key}.") for key in parameters),
                _field("outcome", pa.string(), f"{', '.join(outcome.value for outcome in Outcome)} or {REFUSED}."),
                _field("reason", pa.string(), "Why the throw did not simply land; null if it did."),
                *(_field(column.name, column.type, column.description) for column in self._columns),
                _field("shard", pa.string(), "MCAP file that holds the episode; null when there is none."),
                _field("chunk_offset", pa.int64(), "Where the episode's chunk begins in that file [bytes]."),
                _field("samples", pa.int64(), "Number of samples of the episode."),
                _field("digest", pa.string(), "SHA-256 of the episode: of its header and its message records."),
            ]
        )

    def row(self, trial: int, values: Mapping[str, float], result: ThrowResult, place: Place | None) -> Row:
        """Row of a trial that was run.

        Args:
            trial: Number of the trial.
            values: Its swept values.
            result: What came of it.
            place: Where its episode lies; None if there is none.
        """
        row = self._known(trial, values, result.outcome.value, result.reason)
        for column in self._columns:
            row[column.name] = column.read(result)
        if place is not None:
            row.update(vars(place))
        return row

    def refused_row(self, trial: int, values: Mapping[str, float], reason: str) -> Row:
        """Row of a trial that the plan refused."""
        return self._known(trial, values, REFUSED, reason)

    def _known(self, trial: int, values: Mapping[str, float], outcome: str, reason: str | None) -> Row:
        return {"trial": trial, **{key: values[key] for key in self._parameters}, "outcome": outcome, "reason": reason}

    def table(self, rows: Iterable[Row]) -> pa.Table:
        """Rows, in the given order, as an Arrow table; what a row lacks is null."""
        return pa.Table.from_pylist(list(rows), schema=self.schema)


def encode_table(table: pa.Table) -> bytes:
    """Parquet bytes of a table; equal tables give equal bytes."""
    buffer = io.BytesIO()
    pq.write_table(table.combine_chunks(), buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue()


def _field(name: str, kind: pa.DataType, description: str) -> pa.Field:
    return pa.field(name, kind, metadata={"description": description})
