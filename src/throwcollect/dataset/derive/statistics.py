"""Statistics of a dataset: of the columns of its table, and of its signals, which people need to normalise them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import count_outcomes
from throwcollect.files import StrPath
from throwcollect.progress_log import log_progress

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
_PLACES = frozenset({"trial", "chunk_offset"})
"""Columns of numbers that measure nothing."""
_AXES = ("x", "y", "z")
_JOINT_GROUPS = {"position_rad": "position", "velocity_radps": "velocity", "effort_nm": "effort"}
_OBJECT_GROUPS = {"position_m": "object_position", "velocity_mps": "object_linear_velocity"}
"""Name of a group of signals here, and the attribute of `Samples` that has them."""


@dataclass(frozen=True)
class ColumnStatistics:
    """Statistics of a column of the table of throws, over the rows that have a finite number.

    Extrema, mean and standard deviation (that of the population) are None if there is no such row.

    Attributes:
        count: Number of rows that have a number.
        nulls: Number of rows that have none.
        quantiles: Quantiles at `QUANTILES`, linear between neighbours, by names such as ``q05``.
    """

    count: int
    nulls: int
    min: float | None
    max: float | None
    mean: float | None
    std: float | None
    quantiles: Mapping[str, float]


@dataclass(frozen=True)
class SignalStatistics:
    """Statistics of a recorded signal over all samples of all episodes.

    The standard deviation is that of the population, and 0 for a joint that is locked.
    """

    min: float
    max: float
    mean: float
    std: float


@dataclass(frozen=True)
class Statistics:
    """Statistics of a dataset.

    Attributes:
        trials: Number of trials.
        outcomes: Number of trials of each outcome, most frequent first.
        columns: Each column of numbers of the table of throws.
        episodes: Number of episodes.
        samples: Number of samples that the statistics of signals are over.
        samples_not_finite: Number of samples that are left out, because a number in them is not finite.
        signals: Joints' positions [rad], velocities [rad/s] and torques [Nm], the object's position [m] and velocity
            [m/s] in world: by group, such as ``position_rad``, then by joint or axis. Empty without samples.
    """

    trials: int
    outcomes: Mapping[str, int]
    columns: Mapping[str, ColumnStatistics]
    episodes: int
    samples: int
    samples_not_finite: int
    signals: Mapping[str, Mapping[str, SignalStatistics]]


@dataclass(frozen=True)
class Moments:
    """The moments of the rows of a table that come in pieces (Chan, Golub and LeVeque, 1979).

    All but the number of rows have one value a column; `squares` are sums of squared distances from the mean.
    """

    count: int
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def of(cls, rows: NDArray[np.float64]) -> Moments:
        """Compute the moments of some rows, shape ``(n_rows, n_columns)``, at least one."""
        # Sums run along memory, and their last bits depend on the order.
        rows = np.ascontiguousarray(rows)
        mean = rows.mean(axis=0)
        return cls(len(rows), rows.min(axis=0), rows.max(axis=0), mean, ((rows - mean) ** 2).sum(axis=0))

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations of the population, shape ``(n_columns,)``."""
        deviations: NDArray[np.float64] = np.sqrt(self.squares / self.count)
        return deviations

    def with_more(self, more: Moments) -> Moments:
        """Compute the moments of these rows and of those of `more` together."""
        count = self.count + more.count
        step = more.mean - self.mean
        return Moments(
            count,
            np.minimum(self.minimum, more.minimum),
            np.maximum(self.maximum, more.maximum),
            self.mean + step * (more.count / count),
            self.squares + more.squares + step**2 * (self.count * more.count / count),
        )


def statistics(directory: StrPath) -> Statistics:
    """Compute the statistics of the dataset in a directory; episodes are read one at a time.

    Raises:
        DatasetError: If the directory holds no finished dataset, or it is damaged.
        ConfigError: If its ``config.yaml`` is wrong.
    """
    dataset = Dataset.open(directory)
    moments, left_out = None, 0
    recorded = dataset.recorded
    for throw in log_progress(recorded, len(recorded), "episode", "read"):
        samples = throw.read_samples()[1]
        rows = np.hstack([getattr(samples, name) for name in (*_JOINT_GROUPS.values(), *_OBJECT_GROUPS.values())])
        finite = rows[np.isfinite(rows).all(axis=1)]
        left_out += len(rows) - len(finite)
        if len(finite):
            more = Moments.of(finite)
            moments = moments.with_more(more) if moments else more
    return Statistics(
        trials=len(dataset.throws),
        outcomes=count_outcomes(dataset.throws),
        columns=dict(_summarise_columns(dataset.throws)),
        episodes=len(recorded),
        samples=moments.count if moments else 0,
        samples_not_finite=left_out,
        signals=_summarise_signals(moments, dataset.joints, dataset.config.acted_on) if moments else {},
    )


def _summarise_columns(throws: pa.Table) -> Iterator[tuple[str, ColumnStatistics]]:
    for field in throws.schema:
        if field.name in _PLACES or not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
            continue
        numbers = throws[field.name].drop_null().to_numpy().astype(np.float64)
        numbers = numbers[np.isfinite(numbers)]
        nulls = len(throws) - len(numbers)
        if not len(numbers):
            yield field.name, ColumnStatistics(0, nulls, None, None, None, None, {})
            continue
        quantiles = np.quantile(numbers, QUANTILES).tolist()
        yield (
            field.name,
            ColumnStatistics(
                count=len(numbers),
                nulls=nulls,
                min=float(numbers.min()),
                max=float(numbers.max()),
                mean=float(numbers.mean()),
                std=float(numbers.std()),
                quantiles={f"q{round(100 * at):02d}": value for at, value in zip(QUANTILES, quantiles, strict=True)},
            ),
        )


def _summarise_signals(
    moments: Moments, joints: tuple[str, ...], acted_on: str
) -> dict[str, dict[str, SignalStatistics]]:
    # Rounding must not turn a constant into noise, because people divide by the deviation when they normalise.
    constant = moments.minimum == moments.maximum
    mean, std = np.where(constant, moments.minimum, moments.mean), np.where(constant, 0.0, moments.std)
    columns = (moments.minimum, moments.maximum, mean, std)
    summaries = (SignalStatistics(*numbers) for numbers in zip(*(column.tolist() for column in columns), strict=True))
    groups = {**dict.fromkeys(_JOINT_GROUPS, joints), **{f"{acted_on}_{each}": _AXES for each in _OBJECT_GROUPS}}
    return {group: dict(zip(names, islice(summaries, len(names)), strict=True)) for group, names in groups.items()}
