"""Columns of the table of throws: each field of a result declares its columns once, for writing and for reading.

A field of a result declares its columns by the function that makes it::

    release: ObjectState | None = measured(BodyColumns("when it left the {tool}"))
    flight_time_s: float | None = measured(Number("From release to landing [s]."))

A description may name the ``{tool}`` and the ``{object}``, by which contacts and samples are recorded.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, field
from typing import Any, ClassVar, Literal

from throwcollect.tasks.measures import ObjectState, Peak, Vector

_DECLARED = "columns"


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        name: Name of the column.
        kind: Kind of its values: numbers, whole numbers, or text; null where nothing was measured.
        description: One sentence, with units.
    """

    name: str
    kind: Literal["number", "count", "text"]
    description: str


class Columns(ABC):
    """The columns of one field of a result, by default a single column; all are null where the field is None."""

    @abstractmethod
    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns of the field `name`, for the joints that the task moves."""

    def split(self, value: Any, joints: Sequence[str]) -> Sequence[object]:
        """Split a value of the field, which is not None, into one value for each column."""
        return (value,)

    def join(self, values: Sequence[Any], joints: Sequence[str]) -> Any:
        """Make the field's value from the columns' values, none of which is null."""
        return values[0]


@dataclass(frozen=True)
class Number(Columns):
    """A number, in a column that has the field's name.

    Attributes:
        description: One sentence, with the unit.
    """

    kind: ClassVar[Literal["number", "count"]] = "number"
    description: str

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the column; see `Columns`."""
        return [Column(name, self.kind, self.description)]


class Count(Number):
    """A whole number, in a column that has the field's name."""

    kind = "count"


@dataclass(frozen=True)
class BodyColumns(Columns):
    """A `ObjectState`: ``<field>_time_s``, ``<field>_x_m`` and so on.

    Attributes:
        when: The instant, as the end of a sentence.
    """

    when: str

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns; see `Columns`."""
        descriptions = [
            f"Time since the start of the trial {self.when} [s].",
            *(f"Centre of the {{object}} in world {self.when}, {axis} [m]." for axis in "xyz"),
            *(f"Velocity of the {{object}} in world {self.when}, {axis} [m/s]." for axis in "xyz"),
        ]
        return [Column(column, "number", text) for column, text in zip(body_columns(name), descriptions, strict=True)]

    def split(self, value: ObjectState, joints: Sequence[str]) -> Sequence[object]:
        """Return time, position and velocity; see `Columns`."""
        return (value.time_s, *value.position, *value.velocity)

    def join(self, values: Sequence[Any], joints: Sequence[str]) -> Any:
        """Return the state; see `Columns`."""
        return join_body(values)


def body_columns(name: str) -> list[str]:
    """List the names of the columns of a `ObjectState`: time, position and velocity."""
    return [f"{name}_time_s", *(f"{name}_{axis}_m" for axis in "xyz"), *(f"{name}_v{axis}_mps" for axis in "xyz")]


def join_body(values: Sequence[float]) -> ObjectState:
    """Make a state of the object from the values of its columns."""
    time_s, x, y, z, vx, vy, vz = values
    return ObjectState(time_s, (x, y, z), (vx, vy, vz))


@dataclass(frozen=True)
class SpinColumns(Columns):
    """An angular velocity of the object: ``<field>_x_radps`` and so on.

    Attributes:
        when: The instant, as the end of a sentence.
    """

    when: str

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns; see `Columns`."""
        return [
            Column(
                f"{name}_{axis}_radps",
                "number",
                f"Angular velocity of the {{object}} in world {self.when}, {axis} [rad/s].",
            )
            for axis in "xyz"
        ]

    def split(self, value: Vector, joints: Sequence[str]) -> Sequence[object]:
        """Return the components; see `Columns`."""
        return value

    def join(self, values: Sequence[Any], joints: Sequence[str]) -> Any:
        """Return the vector; see `Columns`."""
        return tuple(values)


@dataclass(frozen=True)
class PeakColumns(Columns):
    """A `Peak`: ``<field>_share`` and ``<field>_joint``.

    Attributes:
        of: Description of the share, as the beginning of a sentence.
    """

    of: str

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns; see `Columns`."""
        return [
            Column(f"{name}_share", "number", f"{self.of} [-]; 1 is at the limit."),
            Column(f"{name}_joint", "text", f"Joint that had {name}_share."),
        ]

    def split(self, value: Peak, joints: Sequence[str]) -> Sequence[object]:
        """Return share and joint; see `Columns`."""
        return (value.share, value.joint)

    def join(self, values: Sequence[Any], joints: Sequence[str]) -> Any:
        """Return the peak; see `Columns`."""
        share, joint = values
        return Peak(joint, share)


@dataclass(frozen=True)
class JointColumns(Columns):
    """A number for each joint that the task moves, by joint: ``<joint>_<field>``.

    Attributes:
        description: One sentence, with the unit; ``{joint}`` stands for the joint.
    """

    description: str

    def declare(self, name: str, joints: Sequence[str]) -> list[Column]:
        """List the columns; see `Columns`."""
        return [Column(f"{joint}_{name}", "number", self.description.replace("{joint}", joint)) for joint in joints]

    def split(self, value: Mapping[str, float], joints: Sequence[str]) -> Sequence[object]:
        """Return the numbers in the order of the joints; see `Columns`."""
        return [value[joint] for joint in joints]

    def join(self, values: Sequence[Any], joints: Sequence[str]) -> Any:
        """Return the numbers by joint; see `Columns`."""
        return dict(zip(joints, values, strict=True))


def measured(columns: Columns) -> Any:
    """Make a field of a result that is stored in these columns, and is None where there is nothing to measure."""
    return field(default=None, metadata={_DECLARED: columns})


def columns_of(declared: Field[Any]) -> Columns | None:
    """Return the columns of a field of a result; None if it was not made by `measured`."""
    columns: Columns | None = declared.metadata.get(_DECLARED)
    return columns
