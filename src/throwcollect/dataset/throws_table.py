"""The table of throws: one row a trial, with what was swept, what came of it, and where its episode lies."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from throwcollect.errors import DatasetError
from throwcollect.sweep.parquet_file import read_parquet
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.throw import Outcome, ThrowResult

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


def _field(name: str, kind: pa.DataType, description: str) -> pa.Field:
    return pa.field(name, kind, metadata={"description": description})


def _number(name: str, description: str) -> pa.Field:
    return _field(name, pa.float64(), description)


def _state_fields(name: str, when: str) -> list[pa.Field]:
    return [
        _number(f"{name}_time_s", f"Time since the start of the trial {when} [s]."),
        *(_number(f"{name}_{axis}_m", f"Ball centre in world {when}, {axis} [m].") for axis in "xyz"),
        *(_number(f"{name}_v{axis}_mps", f"Velocity of the ball in world {when}, {axis} [m/s].") for axis in "xyz"),
    ]


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
            _number(f"{joint}_tracking_error_rad", f"Largest distance of {joint} from its commanded trajectory [rad].")
            for joint in joints
        ),
    ]


def _result_values(result: ThrowResult, joints: Sequence[str]) -> Iterator[object]:
    """Values of `_result_fields`, in their order."""
    for state in (result.release, result.apex, result.landing):
        yield from (None,) * 7 if state is None else (state.time_s, *state.position, *state.velocity)
    yield result.release_speed_mps
    yield result.release_elevation_rad
    yield result.flight_time_s
    yield result.hit_angle_rad
    yield result.recontacts
    for peak in (result.position_peak, result.velocity_peak, result.effort_peak):
        yield from (None, None) if peak is None else (peak.share, peak.joint)
    yield result.effort_saturated_share
    errors = result.tracking_error_rad or {}
    yield from map(errors.get, joints)


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

    def row(self, trial: int, values: Mapping[str, float], result: ThrowResult, place: Place | None) -> Row:
        """Row of a trial that was run.

        Args:
            trial: Number of the trial.
            values: Its swept values.
            result: What came of it.
            place: Where its episode lies; None if there is none.
        """
        row = self._known(trial, values, result.outcome.value, result.reason)
        row.update(zip(self._names, _result_values(result, self._joints), strict=True))
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


def read_throws_table(path: Path, plan: Plan) -> pa.Table:
    """A table of throws, whatever trials its rows are of.

    Args:
        path: The file.
        plan: Its trials; they say which columns there are.

    Raises:
        DatasetError: If the table is missing or damaged, or has other columns.
    """
    table = read_parquet(path)
    schema = ThrowsTable(plan.keys, tuple(plan.config.task.end)).schema
    if not table.schema.equals(schema):
        wrong = sorted(set(table.schema.names) ^ set(schema.names)) or "types of columns"
        raise DatasetError(f"{path}: not the table of this plan: differs in {wrong}")
    return table


def encode_table(table: pa.Table) -> bytes:
    """Parquet bytes of a table; equal tables give equal bytes."""
    buffer = io.BytesIO()
    pq.write_table(table.combine_chunks(), buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue()
