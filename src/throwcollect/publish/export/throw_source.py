"""A dataset as exporters read it: its table, and its throws one by one with their signals, also at a lower rate."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.task_config import TargetColumn
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.sensors import FRAMES
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.trajectories import BODY_COMPONENTS
from throwcollect.episode.sensor_topics import sensor_topics
from throwcollect.errors import DatasetError, refuse_argument
from throwcollect.progress_log import ProgressLog
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.robots.trajectory import JointTrajectory, sample_positions, sample_quintic
from throwcollect.tasks.task import commanded_trajectory
from throwcollect.units import ascii_unit, name_sliding, unit_of_name

NO_IMAGES = "none"
"""The way of leaving out what sensors saw."""
_PLACES = ("shard", "chunk_offset")
"""Columns that say where a recording lies in the dataset, which means nothing in an export."""


def unit_of(column: str) -> str:
    """Find the unit of a column of numbers in ASCII, such as ``m/s^2``; ``1`` for counts and shares."""
    return ascii_unit(unit_of_name(column))


@dataclass(frozen=True)
class Signal:
    """One quantity over time.

    Attributes:
        name: Name of the array ``(n_samples, n_components)``, or ``(n_samples,)`` without components.
        description: One sentence.
        components: Name of each component as a column of its own; empty for a scalar.
        pattern: Names of their columns in short.
    """

    name: str
    description: str
    components: tuple[str, ...] = ()
    pattern: str = ""

    @property
    def unit(self) -> str:
        """Unit of all its components."""
        return unit_of(self.name)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in a table."""
        return self.components or (self.name,)


_JOINT_SIGNALS = {
    "joint_position_rad": "Measured joint positions.",
    "joint_velocity_radps": "Measured joint velocities.",
    "joint_effort_nm": "Torques of the motors; 0 for locked joints.",
    "command_position_rad": "Commanded positions, on the trajectory that controllers were sent.",
    "command_velocity_radps": "Commanded velocities.",
    "command_acceleration_radps2": "Commanded accelerations.",
}
"""Of all joints what is measured, of those that move what is commanded."""
_BODY_SIGNALS = {
    "position_m": ("Centre of the {} in world.", "position"),
    "orientation_xyzw": ("Unit quaternion, {} to world.", "orientation_xyzw"),
    "velocity_mps": ("Velocity of the {} in world.", "velocity"),
    "angular_velocity_radps": ("Angular velocity of the {} in world.", "angular_velocity"),
}


def list_signals(config: Config, targets: Sequence[TargetColumn]) -> Iterator[Signal]:
    """Describe all signals of an exported throw; those of targets have the same value in all its samples.

    Arrays of joints have the units of joints that turn in their names; components of those that slide have their own.
    """
    robot = robot_of(config)
    yield Signal("time_s", "Time since the start of the trial.", pattern="time_s")
    for name, description in _JOINT_SIGNALS.items():
        measured, ending = name.startswith("joint_"), name.removeprefix("joint_")
        joints = robot.joints if measured else config.moving_joints
        names = {joint: f"{joint}_{ending}" for joint in joints}
        components = tuple(name_sliding(own) if joint in robot.sliding else own for joint, own in names.items())
        yield Signal(name, description, components, f"<joint>_{ending}")
    for body in moving_bodies_of(config):
        for ending, (description, quantity) in _BODY_SIGNALS.items():
            components = tuple(f"{body}_{component}" for component in BODY_COMPONENTS[quantity])
            yield Signal(f"{body}_{ending}", description.format(body), components, ", ".join(components))
    yield from (Signal(each.name, each.description, (each.name,), each.name) for each in targets)


Signals = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class ThrowSeries:
    """Time series of one throw.

    Attributes:
        throw: The throw.
        succeeded: Whether it succeeded.
        signals: Each signal of the source by name, ``(n_samples, ...)``.
        trajectory: The trajectory that the controllers were sent.
    """

    throw: Throw
    succeeded: bool
    signals: Signals
    trajectory: JointTrajectory

    def __len__(self) -> int:
        return len(self.signals["time_s"])

    @property
    def done(self) -> NDArray[np.float64]:
        """1 in its last sample and 0 in all others, shape ``(n_samples,)``; times `succeeded`, its rewards."""
        done = np.zeros(len(self))
        done[-1] = 1
        return done

    def find_actions(self, rate_hz: int) -> NDArray[np.float64]:
        """Find the positions commanded one sample later ``(n_samples, n_moving)`` [rad]: the action of each sample.

        The last sample has one, too, as the trajectory goes on behind it, and after its end stays at its last point.
        """
        time_s = self.signals["time_s"]
        return sample_positions(self.trajectory, np.append(time_s[1:], time_s[-1] + 1 / rate_hz))


class ExportSource:
    """A dataset to export, with some streams of its sensors, at a number of samples per second.

    Without a number it is the recorded one, or the largest at which each sample has a frame of each sensor.

    Attributes:
        dataset: The dataset.
        rate_hz: Samples per second in the export.
        targets: Columns of targets that all of its throws have: a policy cannot be conditioned on a target that some
            throws lack.
        signals: Quantities of each throw over time.
        throws: The throws that have an episode, in order of trials.
        table: One row a trial, with ``description`` and ``unit`` in the metadata of each column.
        images: The way in which what sensors saw is stored.
        streams: The streams that are stored, for each sensor that has some of them.
        progress: Logs how many of its trials have been exported.
    """

    def __init__(
        self,
        dataset: Dataset,
        streams: Mapping[str, tuple[str, ...]],
        *,
        rate_hz: int | None = None,
        images: str = NO_IMAGES,
    ) -> None:
        self.dataset, self.streams, self.images, self.throws = dataset, streams, images, dataset.recorded
        if not len(self.throws):
            problem = f"none of its {len(dataset.throws)} trials has an episode to export"
            raise DatasetError(f"{dataset.directory}: {problem}")
        rates = {"joints": dataset.config.record.rate_hz}
        rates |= {name: dataset.config.sensors[name].rate_hz for name in streams}
        highest_hz = gcd(*rates.values())
        if rate_hz is not None and (rate_hz < 1 or highest_hz % rate_hz):
            recorded = ", ".join(f"{name} at {rate} Hz" for name, rate in rates.items())
            expected = f"a divisor of {highest_hz}" + f", or --images {NO_IMAGES}" * (images != NO_IMAGES)
            raise refuse_argument("rate_hz", f"{rate_hz} samples per second of {recorded}", expected=expected)
        self.rate_hz = rate_hz or highest_hz
        self.targets = _list_targets(self.throws)
        self.signals = tuple(list_signals(dataset.config, self.targets))
        self.table = dataset.throws.drop_columns(list(_PLACES))
        self.progress = ProgressLog(len(dataset.throws), "trial", "exported")

    @property
    def _step(self) -> int:
        # Every n-th recorded sample is exported, unchanged.
        return self.dataset.config.record.rate_hz // self.rate_hz

    @property
    def shards(self) -> dict[str, Dataset]:
        """Throws of each recording, by the name of its file without ending."""
        # The name becomes the name of a file of the export, so it must not lead to another directory.
        return {Path(name).stem: self.throws.select(pc.field("shard") == name) for name in self.throws.shards}

    def count_samples(self, throw: Throw) -> int:
        """Count the samples that a throw has in the export."""
        return len(range(throw["samples"])[:: self._step])

    def look(self, throw: Throw, name: str) -> dict[str, NDArray[Any]]:
        """Read what a sensor saw in a throw, one frame a sample, as its attributes in `throw.sensors` have it."""
        with throw.locating_damage():
            sensor = throw.sensors[name]
            every = slice(None, None, sensor.config.rate_hz // self.rate_hz)
            if len(sensor.stamps_ns[every]) != self.count_samples(throw):
                raise DatasetError(f"{name} has {len(sensor)} frames, and there are more or fewer samples")
            return {FRAMES[stream]: getattr(sensor, FRAMES[stream])[every] for stream in self.streams[name]}

    def read(self, throws: Iterable[Throw]) -> Iterator[ThrowSeries]:
        """Read the time series of throws, one throw at a time, as all of them may not fit into memory."""
        for throw in throws:
            yield self.read_throw(throw)
            self.progress.note(throw.trial + 1)

    def read_throw(self, throw: Throw) -> ThrowSeries:
        """Read the time series of a throw."""
        config, (header, recorded) = self.dataset.config, throw.read_samples()
        samples = recorded[:: self._step]
        trajectory = commanded_trajectory(throw.config, recorded)
        time_s = samples.seconds_since(header.start_ns)
        joints = (samples.position, samples.velocity, samples.effort, *sample_quintic(trajectory, time_s))
        signals = {"time_s": time_s, **dict(zip(_JOINT_SIGNALS, joints, strict=True))}
        for number, body in enumerate(moving_bodies_of(config)):
            names = (f"{body}_{ending}" for ending in _BODY_SIGNALS)
            signals |= dict(zip(names, samples.parts_of(number), strict=True))
        signals |= {each.name: np.full((len(samples), 1), throw[each.name]) for each in self.targets}
        return ThrowSeries(throw, throw.outcome == config.task.success, signals, trajectory)


def choose_streams(config: Config, streams: Container[str]) -> dict[str, tuple[str, ...]]:
    """Choose, of some streams, those that sensors record, for each sensor that records some of them."""
    topics = {name: [topic.stream for topic in topics.values()] for name, topics in sensor_topics(config).items()}
    chosen = {name: tuple(each for each in recorded if each in streams) for name, recorded in topics.items()}
    return {name: each for name, each in chosen.items() if each}


def _list_targets(throws: Dataset) -> tuple[TargetColumn, ...]:
    """List the columns of targets that every throw has, in the order of the task."""
    columns = [each for each in throws.config.task.target_columns if each.name in throws.throws.column_names]
    return tuple(each for each in columns if not throws.throws[each.name].null_count)


def read_metadata(field: pa.Field) -> dict[str, str]:
    """Read the metadata of a column of the table, such as its ``unit`` and ``description``."""
    return {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
