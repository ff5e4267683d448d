"""Measures of a result and their columns: each field declares its columns once, for writing and for reading.

A field of a result declares its columns by the function that makes it::

    release: ObjectState | None = measured(BodyColumns("when it left the {tool}"))
    flight_time_s: float | None = measured(Number("From release to landing [s]."))

A description may name the ``{tool}`` and the ``{object}``, by which contacts and samples are recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Vector = tuple[float, float, float]
COLUMNS = "columns"
"""Name of the columns in the metadata of a field."""


@dataclass(frozen=True)
class ObjectState:
    """The object at one instant; world frame.

    Attributes:
        time_s: Time since the start of the trial [s].
        position: Its centre [m].
        velocity: Its velocity [m/s].
    """

    time_s: float
    position: Vector
    velocity: Vector


@dataclass(frozen=True)
class Peak:
    """Largest value of one quantity, of all joints during a trial.

    Attributes:
        joint: Joint that had the value.
        share: Value over limit [-]; 1 is at the limit.
    """

    joint: str
    share: float


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        name: Name of the column.
        kind: Kind of its values: numbers, integers, or strings; null where nothing was measured.
        description: One sentence, with units.
    """

    name: str
    kind: Literal["number", "count", "text"]
    description: str

    def fill(self, **words: str) -> Column:
        """Put words in the place of their names in braces."""
        name, description = self.name, self.description
        for word, text in words.items():
            name, description = name.replace(f"{{{word}}}", text), description.replace(f"{{{word}}}", text)
        return Column(name, self.kind, description)


class Columns:
    """The columns of one field of a result; all are null where the field is None.

    Args:
        columns: The columns, in whose names and descriptions ``{field}`` stands for the name of the field; those with
            ``{joint}`` are there for each joint that the task moves.
        split: Splits a value of the field, which is not None, into one value for each column, given the joints.
    """

    def __init__(
        self,
        *columns: Column,
        split: Callable[[Any, Sequence[str]], Sequence[object]] = lambda value, _: (value,),
    ) -> None:
        self._columns, self.split = columns, split

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns of the field `name`, for the joints that the task moves."""
        of_joints = ((each, joints if "{joint}" in each.name else [""]) for each in self._columns)
        return [each.fill(field=name, joint=joint) for each, own in of_joints for joint in own]


class Number(Columns):
    """A number, in a column that has the field's name; the description is one sentence, with the unit."""

    def __init__(self, description: str) -> None:
        super().__init__(Column("{field}", "number", description))


class Count(Columns):
    """An integer, in a column that has the field's name; the description is one sentence."""

    def __init__(self, description: str) -> None:
        super().__init__(Column("{field}", "count", description))


class BodyColumns(Columns):
    """A `ObjectState`: ``<field>_time_s``, ``<field>_x_m`` and so on; `when` ends a sentence with the instant."""

    def __init__(self, when: str) -> None:
        place, speed = (f"{what} of the {{object}} in world {when}" for what in ("Centre", "Velocity"))
        super().__init__(
            Column("{field}_time_s", "number", f"Time since the start of the trial {when} [s]."),
            *(Column(f"{{field}}_{axis}_m", "number", f"{place}, {axis} [m].") for axis in "xyz"),
            *(Column(f"{{field}}_v{axis}_mps", "number", f"{speed}, {axis} [m/s].") for axis in "xyz"),
            split=lambda state, _: (state.time_s, *state.position, *state.velocity),
        )


class SpinColumns(Columns):
    """An angular velocity of the object: ``<field>_x_radps`` and so on; `when` is as for `BodyColumns`."""

    def __init__(self, when: str) -> None:
        spin = f"Angular velocity of the {{object}} in world {when}"
        columns = (Column(f"{{field}}_{axis}_radps", "number", f"{spin}, {axis} [rad/s].") for axis in "xyz")
        super().__init__(*columns, split=lambda spin, _: spin)


class PeakColumns(Columns):
    """A `Peak`: ``<field>_share`` and ``<field>_joint``; `of` describes the share, as the beginning of a sentence."""

    def __init__(self, of: str) -> None:
        share = Column("{field}_share", "number", f"{of} [-]; 1 is at the limit.")
        joint = Column("{field}_joint", "text", "Joint that had {field}_share.")
        super().__init__(
            share,
            joint,
            split=lambda peak, _: (peak.share, peak.joint),
        )


class JointColumns(Columns):
    """A number for each joint that the task moves, by joint: ``<joint>_<field>``.

    The description is one sentence, with the unit, in which ``{joint}`` stands for the joint.
    """

    def __init__(self, description: str) -> None:
        super().__init__(
            Column("{joint}_{field}", "number", description),
            split=lambda value, joints: [value[joint] for joint in joints],
        )


def measured(columns: Columns) -> Any:
    """Make a field of a result that is stored in these columns, and is None where there is nothing to measure."""
    return field(default=None, metadata={COLUMNS: columns})
