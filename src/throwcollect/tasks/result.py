"""The result of a trial of any task: its outcome, the reason, and the measures of the joints that all tasks have."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, make_dataclass, replace
from enum import Enum
from functools import cache
from types import NoneType
from typing import Any, Generic, TypeVar

from throwcollect.config.scene import BALL
from throwcollect.errors import DatasetError
from throwcollect.tasks.result_columns import (
    COLUMNS,
    Column,
    Columns,
    JointColumns,
    Number,
    Peak,
    PeakColumns,
    measured,
)
from throwcollect.units import name_sliding

LIMIT_VIOLATED, TRACKING_FAILED, LOST = "limit_violated", "tracking_failed", "lost"
"""Outcomes that every task has: the trial succeeded, but a joint violated a limit; a controller did not carry out its
trajectory, or the simulation diverged; no simulation returned an episode."""
REFUSED = "refused"
"""Outcome of a trial that the plan refused, which no task judges."""


_KINDS = {"number": (float, int), "count": (int,), "text": (str,)}
"""Types of the values of a column of each kind."""


class Outcome(str, Enum):
    """How a trial ended; each task has outcomes of its own, among them `LIMIT_VIOLATED`, `TRACKING_FAILED`, `LOST`."""


@dataclass(frozen=True)
class Result:
    """Outcome and measures of a trial; a measure is None where there is nothing to measure.

    Tasks derive their own results from this class. Each field that a task adds declares its columns of the table, which
    say what the measure is (`tasks.result_columns`).

    Attributes:
        outcome: How the trial ended.
        reason: One sentence on why the trial did not simply succeed; None if it did.
    """

    outcome: Outcome
    reason: str | None = None
    position_peak: Peak | None = measured(
        PeakColumns("Largest distance of a moving joint from the middle of its range over half the range")
    )
    velocity_peak: Peak | None = measured(PeakColumns("Largest speed of a joint over its limit"))
    effort_peak: Peak | None = measured(PeakColumns("Largest torque of a joint over its limit"))
    effort_saturated_share: float | None = measured(
        Number("Share of samples in which some joint's torque is at its limit [-].")
    )
    tracking_error_rad: Mapping[str, float] | None = measured(
        JointColumns("Largest distance of {joint} from its commanded trajectory [rad].")
    )


@cache
def with_policy(results: type[Result]) -> type[Result]:
    """Derive the results of trials in which a policy commands the joints, which have one measure more."""
    clipped = Number("Share of samples in which the policy's command was beyond a limit, and was clipped [-].")
    return make_dataclass(
        results.__name__, [("clipped_share", "float | None", measured(clipped))], bases=(results,), frozen=True
    )


AnyResult = TypeVar("AnyResult", bound=Result)


class ResultColumns(Generic[AnyResult]):
    """Writes the results of a task into the columns of a table.

    Attributes:
        columns: First the columns of the measures that the task adds, then the columns that all tasks have.
    """

    def __init__(
        self,
        results: type[AnyResult],
        joints: Sequence[str],
        *,
        tool: str,
        acted_on: str = BALL,
        sliding: Collection[str] = (),
    ) -> None:
        self._joints = tuple(joints)
        self._fields: list[tuple[str, Columns, list[str]]] = []
        self.columns: tuple[Column, ...] = ()
        common = {field.name for field in fields(Result)}
        for field in sorted(fields(results), key=lambda field: field.name in common):
            if (columns := field.metadata.get(COLUMNS)) is None:
                continue
            found = [each.fill(tool=tool, object=acted_on) for each in columns.declare(field.name, joints)]
            for place, each in enumerate(found):
                # A joint that slides has metres where others have radians.
                if each.name.removesuffix(f"_{field.name}") in sliding:
                    text = each.description.replace("[rad]", "[m]")
                    found[place] = replace(each, name=name_sliding(each.name), description=text)
            self._fields.append((field.name, columns, [each.name for each in found]))
            self.columns += tuple(found)

    def write(self, result: AnyResult) -> dict[str, Any]:
        """Make outcome, reason and the values of all columns, by name; None where nothing was measured."""
        values: dict[str, Any] = {"outcome": result.outcome.value, "reason": result.reason}
        for name, columns, names in self._fields:
            value = getattr(result, name)
            parts = [None] * len(names) if value is None else columns.split(value, self._joints)
            values |= zip(names, parts, strict=True)
        return values

    def to_json(self, result: AnyResult) -> str:
        """Write in JSON what `write` makes of a result."""
        values = self.write(result)
        for column in self.columns:
            if not isinstance(value := values[column.name], (*_KINDS[column.kind], NoneType)):
                raise TypeError(f"{column.name}: should be a {column.kind}, is {value!r}")
        return json.dumps(values, allow_nan=False)

    def from_json(self, outcomes: type[Outcome], text: str) -> dict[str, Any]:
        """Read the text that `to_json` writes; returns what `write` has made."""
        try:
            values: dict[str, Any] = json.loads(text)
            names = ["outcome", "reason", *(column.name for column in self.columns)]
            outcomes(values["outcome"])
            return {name: values[name] for name in names}
        except (ValueError, LookupError, TypeError) as error:
            raise DatasetError(f"result of a trial: {error}") from error
