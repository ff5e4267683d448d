"""One throw as people read it: arrays that are read from the recording when they are first looked at."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.target_columns import is_target
from throwcollect.dataset.guesses import THROW, refuse_attribute
from throwcollect.dataset.named_array import refuse_name
from throwcollect.dataset.throws_table import Row, ball_state
from throwcollect.dataset.trajectory_columns import (
    COLUMNS,
    TIMES,
    Column,
    Recorded,
    empty_columns,
    fill,
    name_components,
)
from throwcollect.episode.trajectory_rows import STAMPS
from throwcollect.errors import DatasetError
from throwcollect.extras import lazily

if TYPE_CHECKING:
    from pandas import DataFrame

pd = lazily("pandas")


@dataclass(frozen=True, eq=False)
class BallEvent:
    """The ball at one instant, in world.

    Attributes:
        time_s: Time since the start of the trial [s].
        position: Centre [m], shape ``(3,)``.
        velocity: [m/s], shape ``(3,)``.
    """

    time_s: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True)
class ContactInterval:
    """An interval in which the ball was pressed against one body.

    Attributes:
        body: Name of the tool, ``ground``, or the name of the robot's link.
        start_s: Time of its start, since the start of the trial [s].
        end_s: Time of its end [s]; None if it lasted to the end of the trial.
    """

    body: str
    start_s: float
    end_s: float | None


class _Recording:
    """The rows of an episode, decompressed when a column is first asked for, and kept."""

    def __init__(self, recorded: Recorded) -> None:
        self._recorded = recorded

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that are recorded."""
        return self._recorded.joints

    @cached_property
    def _rows(self) -> NDArray[np.void]:
        return self._recorded.read_rows()

    def column(self, name: str) -> Column:
        """Read a column into an array of its own."""
        joints = self._recorded.joints
        columns = empty_columns([name], self._recorded.samples, len(joints))
        fill(columns, [self._recorded], [self._rows], joints)
        return columns[name]


class _Series:
    """Columns that share their times; each is read when it is first asked for, into an array of its own."""

    _prefix = ""

    def __init__(self, recording: _Recording) -> None:
        self._recording = recording

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} samples, {self.time_s[-1]:.3f} s)"

    def _read_column(self, name: str) -> Column:
        return self._recording.column(f"{self._prefix}.{name}")

    @cached_property
    def time_s(self) -> NDArray[np.float64]:
        """Time since the start of the trial [s], shape ``(n_samples,)``."""
        return self._recording.column(TIMES)

    @cached_property
    def stamps_ns(self) -> NDArray[np.int64]:
        """Simulated time [ns], shape ``(n_samples,)``; as in the messages."""
        return self._recording.column(STAMPS)


class Ball(_Series):
    """The ball during a throw; world frame: x forward, y left, z up."""

    _prefix = "ball"

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Centre [m], shape ``(n_samples, 3)``."""
        return self._read_column("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """Of the centre [m/s], shape ``(n_samples, 3)``."""
        return self._read_column("velocity")

    @cached_property
    def orientation_xyzw(self) -> NDArray[np.float64]:
        """Unit quaternion, ball to world, shape ``(n_samples, 4)``."""
        return self._read_column("orientation_xyzw")

    @cached_property
    def angular_velocity(self) -> NDArray[np.float64]:
        """[rad/s], shape ``(n_samples, 3)``."""
        return self._read_column("angular_velocity")


@dataclass(frozen=True)
class Joint:
    """One joint during a throw.

    Attributes:
        name: Its name.
        time_s: Time since the start of the trial [s], shape ``(n_samples,)``, as all others.
        position: [rad].
        velocity: [rad/s].
        effort: Torque of its motor [Nm]; 0 if it is locked.
    """

    name: str
    time_s: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]


class Joints(_Series):
    """The robot's joints during a throw; ``joints["arm_right_4_joint"]`` is one of them."""

    _prefix = "joints"

    def __getitem__(self, name: str) -> Joint:
        """Return one joint; its arrays are columns of the arrays of all joints.

        Raises:
            ConfigError: If the robot has none of this name; it is also a `KeyError`.
        """
        if name not in self.names:
            raise refuse_name("no joint", name, self.names)
        which = self.names.index(name)
        return Joint(name, self.time_s, self.position[:, which], self.velocity[:, which], self.effort[:, which])

    def __iter__(self) -> Iterator[Joint]:
        return (self[name] for name in self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in the order of the columns of all arrays."""
        return self._recording.joints

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """[rad], shape ``(n_samples, n_joints)``."""
        return self._read_column("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """[rad/s], shape ``(n_samples, n_joints)``."""
        return self._read_column("velocity")

    @cached_property
    def effort(self) -> NDArray[np.float64]:
        """Torques of the motors [Nm], shape ``(n_samples, n_joints)``; 0 for locked joints."""
        return self._read_column("effort")


class Events:
    """What happened to the ball.

    Attributes:
        release: When it left the tool; None if it never did.
        apex: At the highest point of its flight; None without a release.
        landing: When it crossed the landing plane; None if it never did.
    """

    def __init__(self, row: Row, throw: Throw) -> None:
        self._throw = throw
        self.release, self.apex, self.landing = (_make_event(row, name) for name in ("release", "apex", "landing"))

    def __repr__(self) -> str:
        times = {"release": self.release, "apex": self.apex, "landing": self.landing}
        return f"Events({', '.join(f'{name} at {at.time_s:.3f} s' for name, at in times.items() if at) or 'none'})"

    @cached_property
    def contacts(self) -> tuple[ContactInterval, ...]:
        """All contacts of the ball, by start time.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        header = self._throw.episode.read().header
        return tuple(
            ContactInterval(
                contact.body,
                header.seconds_at(contact.start_ns),
                None if contact.end_ns is None else header.seconds_at(contact.end_ns),
            )
            for contact in header.contacts
        )


def _make_event(row: Row, name: str) -> BallEvent | None:
    state = ball_state(row, name)
    return None if state is None else BallEvent(state.time_s, np.array(state.position), np.array(state.velocity))


class Throw:
    """One throw; its recording is read when it is first asked for, and kept as long as the throw is.

    Args:
        table: Table of throws.
        position: Its row there.
        parameters: Swept keys.
        episode: Its episode; None if it has none.
        source: Directory of its dataset, or its configuration, for messages.
    """

    def __init__(
        self, table: pa.Table, position: int, parameters: tuple[str, ...], episode: Recorded | None, source: str
    ) -> None:
        self._table = table
        self._position = position
        self._keys = parameters
        self._episode = episode
        self._source = source

    def __repr__(self) -> str:
        text = f"Throw({self.trial}: {self.outcome}"
        if self.reason is not None:
            text += f": {self.reason}"
        if (landing := self.events.landing) is not None:
            x, y, _ = landing.position
            text += f" at x = {x:.3f} m, y = {y:.3f} m after {landing.time_s:.3f} s"
        return f"{text}; {self._episode.samples} samples)" if self._episode else f"{text}; not recorded)"

    # Type checkers would take any attribute for known if they saw this function.
    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise refuse_attribute(self, name, THROW)

    def __getitem__(self, column: str) -> Any:
        """Return its value in a column of the table of throws, such as ``throw["landing_x_m"]``; None if there is none.

        Raises:
            ConfigError: If there is no such column; it is also a `KeyError`.
        """
        if column not in self._table.column_names:
            raise refuse_name("no column", column, self._table.column_names)
        return self.row[column]

    # Python iterates over everything that can be indexed, and a throw is no sequence.
    __iter__ = None

    def __reduce__(self) -> tuple[type[Throw], tuple[object, ...]]:
        # Another process gets neither the whole table nor the arrays that were read.
        table = pa.Table.from_pylist([self.row], schema=self._table.schema)
        return Throw, (table, 0, self._keys, self._episode, self._source)

    @cached_property
    def row(self) -> Row:
        """Its row in the table of throws, by column; ``docs/dataset.md`` describes them."""
        row: Row = self._table.slice(self._position, 1).to_pylist()[0]
        return row

    @property
    def trial(self) -> int:
        """Number of the trial."""
        return int(self.row["trial"])

    @property
    def parameters(self) -> dict[str, float]:
        """Value of each swept key, in the key's unit."""
        return {key: self.row[key] for key in self._keys}

    @property
    def target(self) -> dict[str, float]:
        """Where it should end, by column of the table such as ``target_x_m``; empty if it has no target."""
        return {name: value for name, value in self.row.items() if is_target(name) and value is not None}

    @property
    def miss_m(self) -> float | None:
        """Distance of the landing from the target [m]; None if it has no target, or nothing landed."""
        miss: float | None = self.row.get("miss_m")
        return miss

    @property
    def outcome(self) -> str:
        """How the trial ended: ``landed``, ``refused`` and so on."""
        return str(self.row["outcome"])

    @property
    def reason(self) -> str | None:
        """Why the trial did not simply succeed, such as why a throw did not land; None if it did."""
        reason: str | None = self.row["reason"]
        return reason

    @property
    def recorded(self) -> bool:
        """Whether it has an episode; trials that were refused or lost have none."""
        return self._episode is not None

    @cached_property
    def events(self) -> Events:
        """Release, apex and landing, and the contacts of the ball."""
        return Events(self.row, self)

    @property
    def episode(self) -> Recorded:
        """Its episode.

        Raises:
            DatasetError: If it has none.
        """
        if self._episode is None:
            why = self.outcome if self.reason is None else f"{self.outcome}: {self.reason}"
            raise DatasetError(
                f"trial {self.trial} has no episode: {why}",
                path=Path(self._source),
                hint="leave such trials out: dataset.recorded",
            )
        return self._episode

    @cached_property
    def _recording(self) -> _Recording:
        return _Recording(self.episode)

    @cached_property
    def ball(self) -> Ball:
        """The ball over time.

        Raises:
            DatasetError: If the throw has no episode; its columns raise it if the episode is damaged.
        """
        return Ball(self._recording)

    @cached_property
    def joints(self) -> Joints:
        """The joints over time.

        Raises:
            DatasetError: If the throw has no episode; its columns raise it if the episode is damaged.
        """
        return Joints(self._recording)

    def to_pandas(self) -> DataFrame:
        """Make a DataFrame of the motion of ball and joints: one row a sample, by time since the start of the trial.

        Columns are named as those of `throwcollect dataset export --to parquet`, such as ``ball_x_m`` and
        ``arm_right_4_joint_position_rad``.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
            MissingExtraError: If pandas is not installed.
        """
        parts = {name: self._recording.column(name) for name in COLUMNS if name not in (TIMES, STAMPS)}
        columns = {
            component: values[:, index]
            for name, values in parts.items()
            for index, component in enumerate(name_components(name, self._recording.joints))
        }
        return pd.DataFrame(columns, index=pd.Index(self._recording.column(TIMES), name=TIMES))
