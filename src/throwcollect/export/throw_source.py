"""A dataset as exporters read it: its table, and its throws one by one with their signals, also at another rate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from operator import index
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.arguments import refuse_argument
from throwcollect.config.task_config import TargetColumn
from throwcollect.dataset.damage import read_samples
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import Samples
from throwcollect.errors import DatasetError
from throwcollect.export.signals import Signal, list_signals
from throwcollect.extras import lazily
from throwcollect.progress_log import ProgressLog
from throwcollect.robots.quintic_curve import sample_positions, sample_quintic
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.tasks.task import trajectory_of
from throwcollect.units import NS_PER_S

interpolate = lazily("scipy.interpolate", extra="export")


_PLACES = ("shard", "chunk_offset")
"""Columns that say where a recording lies in the dataset, which means nothing in an export."""

Signals = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class ExportableThrow:
    """A throw that can be exported, before it is read; `samples` is the number of samples in the export."""

    trial: int
    samples: int
    succeeded: bool


@dataclass(frozen=True)
class ThrowSeries:
    """One throw with its time series.

    Attributes:
        trial: Number of its trial.
        succeeded: Whether it succeeded.
        signals: Each signal of the source by name, ``(n_samples, ...)``.
        trajectory: The trajectory that the controllers were sent.
        target: Where it should end, by column of targets of the source.
    """

    trial: int
    succeeded: bool
    signals: Signals
    trajectory: JointTrajectory
    target: Mapping[str, float]

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
        shards: Throws of each recording, by the name of its file without ending; all in order of trials.
        table: One row a trial, with ``description`` and ``unit`` in the metadata of each column.
        progress: Logs how many of its trials have been exported.
    """

    dataset: Dataset
    rate_hz: int
    targets: tuple[TargetColumn, ...]
    signals: tuple[Signal, ...]
    shards: Mapping[str, tuple[ExportableThrow, ...]]
    table: pa.Table
    progress: ProgressLog

    @classmethod
    def open(cls, directory: Path, *, rate_hz: int | None = None) -> ExportSource:
        """Open a dataset to export it, at a number of samples per second, or else at the recorded one."""
        dataset = Dataset.open(directory)
        recorded_hz = dataset.config.record.rate_hz
        if rate_hz is not None and not 1 <= index(rate_hz) <= recorded_hz:
            expected = f"1 to {recorded_hz}, at which {directory} was recorded"
            raise refuse_argument("rate_hz", f"{rate_hz} samples per second", expected=expected)
        if not len(dataset.recorded):
            raise DatasetError(f"{directory}: none of its {len(dataset.throws)} trials has an episode to export")
        rate_hz = rate_hz or recorded_hz
        targets = _list_targets(dataset)
        return cls(
            dataset,
            rate_hz,
            targets,
            list_signals(dataset.joints, dataset.moving_joints, targets),
            _list_entries(dataset, rate_hz),
            dataset.throws.drop_columns(list(_PLACES)),
            ProgressLog(len(dataset.throws), "trial", "exported"),
        )

    @property
    def entries(self) -> tuple[ExportableThrow, ...]:
        """All throws."""
        return tuple(entry for entries in self.shards.values() for entry in entries)

    def throws(self, entries: Iterable[ExportableThrow]) -> Iterator[ThrowSeries]:
        """Read throws with their time series, one at a time, as all of them may not fit into memory."""
        dataset = self.dataset
        for entry in entries:
            header, recorded = read_samples(dataset, entry.trial)
            samples = resample(recorded, recorded_hz=dataset.config.record.rate_hz, rate_hz=self.rate_hz)
            planned = dataset.plan.trial(entry.trial)
            trajectory = trajectory_of(dataset.plan.config_of(planned))
            signals = _compute_signals(samples, trajectory, header.start_ns)
            target = {column.name: planned.target[column.name] for column in self.targets}
            signals |= {name: np.full((len(samples), 1), value) for name, value in target.items()}
            yield ThrowSeries(entry.trial, entry.succeeded, signals, trajectory, target)
            self.progress.note(entry.trial + 1)


def _list_entries(dataset: Dataset, rate_hz: int) -> dict[str, tuple[ExportableThrow, ...]]:
    shards: dict[str, list[ExportableThrow]] = {}
    for row in dataset.throws.select(["trial", "outcome", "shard", "samples"]).to_pylist():
        if row["shard"] is not None:
            count = count_resampled(row["samples"], recorded_hz=dataset.config.record.rate_hz, rate_hz=rate_hz)
            entry = ExportableThrow(row["trial"], count, row["outcome"] == dataset.config.task.success)
            # The name becomes the name of a file of the export, so it must not lead to another directory.
            shards.setdefault(Path(row["shard"]).stem, []).append(entry)
    return {shard: tuple(entries) for shard, entries in shards.items()}


def _list_targets(dataset: Dataset) -> tuple[TargetColumn, ...]:
    """List the columns of targets that every throw with an episode has, in the order of the task."""
    throws = dataset.recorded.throws
    columns = [each for each in dataset.config.task.target_columns if each.name in throws.column_names]
    return tuple(each for each in columns if not throws[each.name].null_count)


def _compute_signals(samples: Samples, trajectory: JointTrajectory, start_ns: int) -> dict[str, NDArray[np.float64]]:
    time_s = samples.seconds_since(start_ns)
    position, velocity, acceleration = sample_quintic(trajectory, time_s)
    return {
        "time_s": time_s,
        "joint_position_rad": samples.position,
        "joint_velocity_radps": samples.velocity,
        "joint_effort_nm": samples.effort,
        "command_position_rad": position,
        "command_velocity_radps": velocity,
        "command_acceleration_radps2": acceleration,
        "ball_position_m": samples.ball_position,
        "ball_orientation_xyzw": samples.ball_orientation_xyzw,
        "ball_velocity_mps": samples.ball_linear_velocity,
        "ball_angular_velocity_radps": samples.ball_angular_velocity,
    }


def read_metadata(field: pa.Field) -> dict[str, str]:
    """Read the metadata of a column of the table, such as its ``unit`` and ``description``."""
    return {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}


def count_resampled(samples: int, *, recorded_hz: int, rate_hz: int) -> int:
    """Count the samples that `resample` makes of a number of recorded ones."""
    return (samples - 1) * rate_hz // recorded_hz + 1


def resample(samples: Samples, *, recorded_hz: int, rate_hz: int) -> Samples:
    """Compute samples at a lower rate, or the same, from the first recorded one to the last instant within the record.

    If the rate divides the recorded one, these are every n-th recorded sample. Otherwise positions of joints and ball
    lie on the cubic through positions and velocities of both neighbours; all else is linear between them, and the
    ball's orientation is normalised. Nothing is filtered.
    """
    if recorded_hz % rate_hz == 0:
        return samples[:: recorded_hz // rate_hz]
    count = count_resampled(len(samples), recorded_hz=recorded_hz, rate_hz=rate_hz)
    # In units of the recorded spacing, so that instants of recorded samples are hit exactly.
    places = np.arange(count) * recorded_hz / rate_hz
    orientation = _interpolate_linearly(_remove_flips(samples.ball_orientation_xyzw), places)
    return Samples(
        stamps_ns=samples.stamps_ns[0] + np.round(np.arange(count) * (NS_PER_S / rate_hz)).astype(np.int64),
        position=_interpolate_cubically(samples.position, samples.velocity / recorded_hz, places),
        velocity=_interpolate_linearly(samples.velocity, places),
        effort=_interpolate_linearly(samples.effort, places),
        ball_position=_interpolate_cubically(samples.ball_position, samples.ball_linear_velocity / recorded_hz, places),
        ball_orientation_xyzw=orientation / np.linalg.norm(orientation, axis=1, keepdims=True),
        ball_linear_velocity=_interpolate_linearly(samples.ball_linear_velocity, places),
        ball_angular_velocity=_interpolate_linearly(samples.ball_angular_velocity, places),
    )


def _interpolate_linearly(values: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    before = np.minimum(places.astype(np.intp), len(values) - 1)
    after = np.minimum(before + 1, len(values) - 1)
    share = (places - before)[:, np.newaxis]
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
    turns = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0
    signs = np.where(np.cumsum(turns) % 2, -1.0, 1.0)
    return np.vstack([quaternions[:1], quaternions[1:] * signs[:, np.newaxis]])
