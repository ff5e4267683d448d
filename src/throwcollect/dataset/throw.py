"""One throw as people read it: arrays that are read from the recording when they are first looked at."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.sensors import SensorSections
from throwcollect.config.task_config import is_target
from throwcollect.config.values import column_of, with_sensors, with_values
from throwcollect.dataset.mcap_reader import EpisodePlace, open_mcap
from throwcollect.dataset.motion import Body, Joints
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.dataset.throws_table import Row, body_state
from throwcollect.dataset.trajectories import (
    BODY_COMPONENTS,
    JOINT_COLUMNS,
    TIMES,
    name_components,
)
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.message_table import list_body_fields, read_column
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.episode.topics import Rows, rotate
from throwcollect.errors import DatasetError
from throwcollect.extras import lazily
from throwcollect.robots.description import full_description, robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.units import NS_PER_S
from throwcollect.wording import command

if TYPE_CHECKING:
    from pandas import DataFrame

pd = lazily("pandas")


@dataclass(frozen=True, eq=False)
class BodyEvent:
    """The object at one instant, in world.

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
    """An interval in which the object was pressed against one body.

    Attributes:
        body: Name of the tool, ``ground``, or the name of the robot's link or of the body of the scene.
        start_s: Time of its start, since the start of the trial [s].
        end_s: Time of its end [s]; None if it lasted to the end of the trial.
    """

    body: str
    start_s: float
    end_s: float | None


class Events:
    """What happened to the object.

    Attributes:
        release: When it left the tool; None if it never did.
        apex: At the highest point of its flight; None without a release.
        landing: When it crossed the landing plane; None if it never did.
        hit: When the tool first touched the puck of a task such as ``slide``; None if it never did.
        leave: When the tool last lost contact with the puck; None if it never did.
        rest: Where it came to rest; None if it did not, or the task does not ask for that.
    """

    def __init__(self, row: Row, throw: Throw) -> None:
        self._throw = throw
        self.release, self.apex, self.landing = (_make_event(row, name) for name in ("release", "apex", "landing"))
        self.hit, self.leave, self.rest = (_make_event(row, name) for name in ("hit", "leave", "rest"))

    def __repr__(self) -> str:
        times = {name: at for name, at in vars(self).items() if isinstance(at, BodyEvent)}
        return f"Events({', '.join(f'{name} at {at.time_s:.3f} s' for name, at in times.items()) or 'none'})"

    @property
    def left(self) -> BodyEvent | None:
        """When the tool had let the object go: its release, or when it left."""
        return self.release or self.leave

    @property
    def end(self) -> BodyEvent | None:
        """Where it ended: its landing, or its rest."""
        return self.landing or self.rest

    @cached_property
    def contacts(self) -> tuple[ContactInterval, ...]:
        """All contacts of the object, by start time.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        header = self._throw.read_episode().header
        return tuple(
            ContactInterval(
                contact.body,
                header.seconds_at(contact.start_ns),
                None if contact.end_ns is None else header.seconds_at(contact.end_ns),
            )
            for contact in header.contacts
        )


def _make_event(row: Row, name: str) -> BodyEvent | None:
    state = body_state(row, name)
    return None if state is None else BodyEvent(state.time_s, np.array(state.position), np.array(state.velocity))


@dataclass(eq=False, repr=False)
class Throw:
    """One throw; its recording is read when it is first asked for, and kept as long as the throw is.

    It is made of a table of throws and its row there, the swept keys, its episode or where that lies (None if it has
    none), the directory of its dataset or its configuration for messages, and the configuration of its dataset.
    """

    _table: pa.Table
    _position: int
    _keys: tuple[str, ...]
    _episode: EpisodePlace | Episode | None
    _source: str
    _config: Config

    def __repr__(self) -> str:
        text = f"Throw({self.trial}: {self.outcome}"
        if self.reason is not None:
            text += f": {self.reason}"
        if (end := self.events.end) is not None:
            x, y, _ = end.position
            text += f" at x = {x:.3f} m, y = {y:.3f} m after {end.time_s:.3f} s"
        return f"{text}; {self.row['samples']} samples)" if self.recorded else f"{text}; not recorded)"

    def __getitem__(self, column: str) -> Any:
        """Return its value in a column of the table of throws, such as ``throw["landing_x_m"]``; None if there is none.

        Raises:
            KeyError: If there is no such column.
        """
        return self.row[column]

    def __contains__(self, column: object) -> bool:
        return column in self._table.column_names

    # Python iterates over everything that can be indexed, and a throw is no sequence.
    __iter__ = None

    def __reduce__(self) -> tuple[type[Throw], tuple[object, ...]]:
        # Another process gets neither the whole table nor the arrays that were read.
        table = pa.Table.from_pylist([self.row], schema=self._table.schema)
        return Throw, (table, 0, self._keys, self._episode, self._source, self._config)

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
        """Value of each swept key, in the key's unit; by dotted key, as `Simulator.throw` takes them."""
        return {key: self.row[column_of(key)] for key in self._keys}

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
        """Release, apex and landing, and the contacts of the object."""
        return Events(self.row, self)

    def read_episode(self, *, sensors: bool = False) -> Episode:
        """Read its episode, with everything that was recorded; what sensors saw only if that is asked for.

        Raises:
            DatasetError: If it has none, or it is damaged.
        """
        if self._episode is None:
            why = self.outcome if self.reason is None else f"{self.outcome}: {self.reason}"
            raise DatasetError(
                f"trial {self.trial} has no episode: {why}",
                path=Path(self._source),
                hint="leave such trials out: dataset.recorded",
            )
        return self._episode.read(sensors=sensors) if isinstance(self._episode, EpisodePlace) else self._episode

    @cached_property
    def sensors(self) -> dict[str, SensorFrames]:
        """What the sensors of the configuration saw, by name of the sensor; frames are read when they are asked for.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        with self.locating_damage():
            seen = self.read_episode(sensors=True).sensors
            # A throw in memory is not rendered before its frames are asked for.
            return self._open_sensors(self.config, seen or self._render(self.config))

    @property
    def config(self) -> Config:
        """The configuration with the values of this trial."""
        return with_values(self._config, self.parameters)

    def render(self, sensors: SensorSections) -> dict[str, SensorFrames]:
        """Render what other sensors see of the recorded samples.

        Args:
            sensors: Sections of sensors by name, as below the key ``sensors`` of a configuration.

        Returns:
            Their frames, as in `sensors`.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
            ConfigError: If a section is wrong, or a link does not exist.
        """
        config = with_sensors(self.config, sensors)
        with self.locating_damage():
            return self._open_sensors(config, self._render(config))

    def _render(self, config: Config) -> tuple[Chunk, ...]:
        header, samples = self._recording
        # Commands that only read would be slower to begin.
        from throwcollect.sensing.recorder import SensorRecorder

        return SensorRecorder(Channels(config, full_description(config))).record(config, header.trial, samples)

    def _open_sensors(self, config: Config, chunks: Sequence[Chunk]) -> dict[str, SensorFrames]:
        return {name: SensorFrames(name, config, *self._recording, chunks) for name in config.sensors}

    @cached_property
    def _recording(self) -> tuple[EpisodeHeader, Samples]:
        episode = self.read_episode()
        return episode.header, episode.samples(robot_of(self._config).joints)

    def read_samples(self) -> tuple[EpisodeHeader, Samples]:
        """Read the header of its episode, and its samples.

        Raises:
            DatasetError: If it has none, or it is damaged; the error names the dataset and the trial.
        """
        with self.locating_damage():
            return self._recording

    @contextmanager
    def locating_damage(self) -> Iterator[None]:
        """Add dataset, trial and a command that finds more to an error that its episode raises without them."""
        try:
            yield
        except DatasetError as error:
            if error.path is not None:
                raise
            located = error.locate(Path(self._source), f"trial {self.trial}")
            located.hint = located.hint or command("dataset", "verify", self._source)
            raise located from error

    @cached_property
    def _rows(self) -> tuple[int, Rows]:
        """Start of the episode [ns], and its samples in place (`MessageTable.rows`)."""
        joints = robot_of(self._config).joints
        with self.locating_damage():
            if isinstance(self._episode, EpisodePlace):
                with open_mcap(self._episode.path) as contents:
                    return self._episode.start_ns, self._episode.read_rows(contents, joints)
            episode = self.read_episode()
            return episode.header.start_ns, episode.table.rows(joints)

    def _read(self, fields: Iterable[str]) -> list[NDArray[Any]]:
        """Copy times, stamps, and some fields of the samples."""
        start_ns, rows = self._rows
        stamps = read_column(rows, "stamps_ns")
        return [(stamps - start_ns) / NS_PER_S, stamps, *(read_column(rows, field) for field in fields)]

    def _read_body(self, name: str, number: int) -> Body:
        times, stamps, position, turn, linear, angular = self._read(list_body_fields(number).values())
        velocity, spin = np.ascontiguousarray(rotate(turn, linear, angular, inverse=False))
        return Body(name, times, stamps, position, turn, velocity, spin)

    @cached_property
    def object(self) -> Body:
        """The body that the robot acts on, over time, such as the ball; it is one of `bodies`.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        return self._read_body(self._config.acted_on, 0)

    @property
    def ball(self) -> Body:
        """Another name of `object`."""
        return self.object

    @cached_property
    def joints(self) -> Joints:
        """The joints over time.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        return Joints(robot_of(self._config).joints, *self._read(JOINT_COLUMNS.values()))

    @cached_property
    def bodies(self) -> dict[str, Body]:
        """All bodies that move, over time, by name: the object, and those of the scene.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
        """
        acted_on, *others = moving_bodies_of(self._config)
        return {acted_on: self.object} | {name: self._read_body(name, k) for k, name in enumerate(others, start=1)}

    def to_pandas(self) -> DataFrame:
        """Make a DataFrame of the motion of joints and bodies: one row a sample, by time since the start of the trial.

        Columns are named as those of `throwcollect dataset export --to parquet`, such as ``ball_x_m`` and
        ``arm_right_4_joint_position_rad``.

        Raises:
            DatasetError: If the throw has no episode, or it is damaged.
            MissingExtraError: If pandas is not installed.
        """
        columns: dict[str, NDArray[np.float64]] = {}
        sliding = robot_of(self._config).sliding
        for name, quantity in JOINT_COLUMNS.items():
            values = getattr(self.joints, quantity)
            columns |= dict(zip(name_components(name, self.joints.names, sliding), values.T, strict=True))
        for body, motion in self.bodies.items():
            for quantity, components in BODY_COMPONENTS.items():
                names = (f"{body}_{component}" for component in components)
                columns |= dict(zip(names, getattr(motion, quantity).T, strict=True))
        return pd.DataFrame(columns, index=pd.Index(self.joints.time_s, name=TIMES))
