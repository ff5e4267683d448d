"""A dataset as exporters read it: its table, and its throws one by one with their signals, also at another rate."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import gcd
from operator import index
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
from throwcollect.episode.record import Samples
from throwcollect.episode.sensor_topics import sensor_topics
from throwcollect.errors import DatasetError, refuse_argument
from throwcollect.extras import lazily
from throwcollect.progress_log import ProgressLog
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.robots.trajectory import JointTrajectory, sample_positions, sample_quintic
from throwcollect.tasks.task import commanded_trajectory
from throwcollect.units import NS_PER_S, ascii_unit, name_sliding, unit_of_name

interpolate = lazily("scipy.interpolate")


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
        each: Its components in words.
        pattern: Names of their columns in short.
    """

    name: str
    description: str
    components: tuple[str, ...] = ()
    each: str = ""
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
    "position_m": ("Centre of the {} in world.", "position", "xyz"),
    "orientation_xyzw": ("Unit quaternion, {} to world.", "orientation_xyzw", "xyzw"),
    "velocity_mps": ("Velocity of the {} in world.", "velocity", "xyz"),
    "angular_velocity_radps": ("Angular velocity of the {} in world.", "angular_velocity", "xyz"),
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
        each = f"{len(joints)} joints" if measured else "moving joints"
        yield Signal(name, description, components, each, f"<joint>_{ending}")
    for body in moving_bodies_of(config):
        for ending, (description, quantity, axes) in _BODY_SIGNALS.items():
            components = tuple(f"{body}_{component}" for component in BODY_COMPONENTS[quantity])
            pattern = ", ".join(components)
            yield Signal(f"{body}_{ending}", description.format(body), components, ", ".join(axes), pattern)
    yield from (Signal(each.name, each.description, (each.name,), "target", each.name) for each in targets)


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


@dataclass(frozen=True)
class ExportSource:
    """A dataset to export.

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

    dataset: Dataset
    rate_hz: int
    targets: tuple[TargetColumn, ...]
    signals: tuple[Signal, ...]
    throws: Dataset
    table: pa.Table
    images: str
    streams: Mapping[str, tuple[str, ...]]
    progress: ProgressLog

    @classmethod
    def of(
        cls,
        dataset: Dataset,
        streams: Mapping[str, tuple[str, ...]],
        *,
        rate_hz: int | None = None,
        images: str = NO_IMAGES,
    ) -> ExportSource:
        """Take a dataset to export it, with some streams of its sensors, at a number of samples per second.

        Without a number it is the recorded one, or the largest at which each sample has a frame of each sensor.
        """
        directory, recorded_hz = dataset.directory, dataset.config.record.rate_hz
        if rate_hz is not None and not 1 <= index(rate_hz) <= recorded_hz:
            expected = f"1 to {recorded_hz}, at which {directory} was recorded"
            raise refuse_argument("rate_hz", f"{rate_hz} samples per second", expected=expected)
        throws = dataset.recorded
        if not len(throws):
            raise DatasetError(f"{directory}: none of its {len(dataset.throws)} trials has an episode to export")
        rates = {name: dataset.config.sensors[name].rate_hz for name in streams}
        if rate_hz is not None and any(rate % rate_hz for rate in rates.values()):
            seen = ", ".join(f"{name} at {rate} Hz" for name, rate in rates.items())
            expected = f"a divisor of {gcd(*rates.values())}" + f", or --images {NO_IMAGES}" * (images != NO_IMAGES)
            raise refuse_argument("rate_hz", f"{rate_hz} samples per second, and images of {seen}", expected=expected)
        rate_hz = rate_hz or gcd(*rates.values()) or recorded_hz
        targets = _list_targets(throws)
        return cls(
            dataset,
            rate_hz,
            targets,
            tuple(list_signals(dataset.config, targets)),
            throws,
            dataset.throws.drop_columns(list(_PLACES)),
            images,
            streams,
            ProgressLog(len(dataset.throws), "trial", "exported"),
        )

    @property
    def shards(self) -> dict[str, Dataset]:
        """Throws of each recording, by the name of its file without ending."""
        # The name becomes the name of a file of the export, so it must not lead to another directory.
        return {Path(name).stem: self.throws.select(pc.field("shard") == name) for name in self.throws.shards}

    def count_samples(self, throw: Throw) -> int:
        """Count the samples that a throw has in the export."""
        return count_resampled(throw["samples"], recorded_hz=self.dataset.config.record.rate_hz, rate_hz=self.rate_hz)

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
        samples = resample(recorded, recorded_hz=config.record.rate_hz, rate_hz=self.rate_hz)
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


def count_resampled(samples: int, *, recorded_hz: int, rate_hz: int) -> int:
    """Count the samples that `resample` makes of a number of recorded ones."""
    return (samples - 1) * rate_hz // recorded_hz + 1


def resample(samples: Samples, *, recorded_hz: int, rate_hz: int) -> Samples:
    """Compute samples at a lower rate, or the same, from the first recorded one to the last instant within the record.

    If the rate divides the recorded one, these are every n-th recorded sample. Otherwise positions of joints and bodies
    lie on the cubic through positions and velocities of both neighbours; all else is linear between them, and the
    orientations are normalised. Nothing is filtered.
    """
    if recorded_hz % rate_hz == 0:
        return samples[:: recorded_hz // rate_hz]
    count = count_resampled(len(samples), recorded_hz=recorded_hz, rate_hz=rate_hz)
    # In units of the recorded spacing, so that instants of recorded samples are hit exactly.
    places = np.arange(count) * recorded_hz / rate_hz
    bodies = range(samples.bodies.shape[1] + 1)
    recorded = np.stack([np.hstack(samples.parts_of(number)) for number in bodies], axis=1)
    recorded[..., 3:7] = _remove_flips(recorded[..., 3:7])
    between = _interpolate_linearly(recorded, places)
    between[..., :3] = _interpolate_cubically(recorded[..., :3], recorded[..., 7:10] / recorded_hz, places)
    between[..., 3:7] /= np.linalg.norm(between[..., 3:7], axis=-1, keepdims=True)
    position, turn, linear, angular = np.split(between[:, 0], (3, 7, 10), axis=1)
    elapsed_ns = np.round(np.arange(count) * (NS_PER_S / rate_hz)).astype(np.int64)
    return Samples(
        stamps_ns=samples.stamps_ns[0] + elapsed_ns,
        position=_interpolate_cubically(samples.position, samples.velocity / recorded_hz, places),
        velocity=_interpolate_linearly(samples.velocity, places),
        effort=_interpolate_linearly(samples.effort, places),
        object_position=position,
        object_orientation_xyzw=turn,
        object_linear_velocity=linear,
        object_angular_velocity=angular,
        bodies=between[:, 1:],
        # A command holds until the next one.
        command=samples.command[places.astype(np.intp)],
    )


def _interpolate_linearly(values: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    before = np.minimum(places.astype(np.intp), len(values) - 1)
    after = np.minimum(before + 1, len(values) - 1)
    share = (places - before).reshape(-1, *[1] * (values.ndim - 1))
    between: NDArray[np.float64] = (1 - share) * values[before] + share * values[after]
    return between


def _interpolate_cubically(
    values: NDArray[np.float64], slopes: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    if len(values) < 2:
        return values[: len(places)]
    curve: NDArray[np.float64] = interpolate.CubicHermiteSpline(np.arange(len(values)), values, slopes)(places)
    return curve


def _remove_flips(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose, of the two quaternions of each orientation, the one that is near the quaternion before."""
    # Each flip turns the sign of all quaternions that follow, so that two flips cancel out.
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0
    signs = np.where(np.cumsum(turns, axis=0) % 2, -1.0, 1.0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., np.newaxis]])
