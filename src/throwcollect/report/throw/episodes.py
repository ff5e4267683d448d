"""The recordings that a report reads: departures from ballistic motion, and a few throws to look at."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.damage import read_samples
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader
from throwcollect.progress_log import log_progress
from throwcollect.report.outcomes import LANDED, Outcomes
from throwcollect.report.throw.landings import Landings
from throwcollect.robots.quintic_curve import sample_positions
from throwcollect.tasks.task import trajectory_of
from throwcollect.tasks.throw.flight import flight_residual, release_of
from throwcollect.tasks.throw.throw_config import throw_section

MOST_RESIDUALS = 2000
"""Most episodes whose flight is computed again, which takes some 15 s; `verify` computes the flights of all."""
_MOST_LANDED = 6
_MOST_OTHERS = 3


@dataclass(frozen=True)
class Residuals:
    """How far recorded flights depart from ballistic motion.

    Attributes:
        episodes: Number of episodes in the dataset.
        checked: Number of episodes that were compared; if not all, they were chosen at random.
        distance_m: Largest distance of each flight that could be compared [m], shape ``(n,)``; nan if a sample is not a
            number.
    """

    episodes: int
    checked: int
    distance_m: NDArray[np.float64]

    @property
    def finite_m(self) -> NDArray[np.float64]:
        """The distances that are numbers [m]."""
        return self.distance_m[np.isfinite(self.distance_m)]


@dataclass(frozen=True)
class BallPath:
    """The ball of one throw.

    Attributes:
        positions: Ball centre in world [m], shape ``(n_samples, 3)``.
        release: Index of the first sample after the release; None if it was not released.
    """

    trial: int
    outcome: str
    positions: NDArray[np.float64]
    release: int | None


@dataclass(frozen=True)
class JointMotion:
    """The moving joints of one throw.

    Attributes:
        trial: Number of the trial.
        joints: Their names.
        times_s: Since the start of the trial [s], shape ``(n_samples,)``.
        commanded: Positions on the trajectory that the controllers were sent [rad], shape ``(n_samples, n_joints)``.
        measured: Recorded positions [rad], shape ``(n_samples, n_joints)``.
        release_s: Since the start of the trial [s]; None if the ball was not released.
    """

    trial: int
    joints: tuple[str, ...]
    times_s: NDArray[np.float64]
    commanded: NDArray[np.float64]
    measured: NDArray[np.float64]
    release_s: float | None

    def span(self, column: int) -> tuple[float, float]:
        """Range of positions to show of a joint [°]: at least 6°, so that a joint at rest looks at rest."""
        both = np.degrees(np.concatenate([self.commanded[:, column], self.measured[:, column]]))
        both = both[np.isfinite(both)]
        low, high = (float(both.min()), float(both.max())) if len(both) else (0.0, 0.0)
        room = max(0.05 * (high - low), 3.0 - (high - low) / 2)
        return low - room, high + room


def measure_residuals(dataset: Dataset) -> Residuals:
    """Compare flights with ballistic motion, at most `MOST_RESIDUALS` of them."""
    trials = dataset.recorded.throws["trial"].to_numpy()
    # Episodes are chosen at random, as every n-th point of a Sobol sequence or a grid would lie on a lattice.
    chosen = np.sort(np.random.default_rng(0).permutation(trials)[:MOST_RESIDUALS])
    distances = []
    for trial in log_progress(chosen.tolist(), len(chosen), "flight", "compared"):
        header, samples = read_samples(dataset, trial)
        config = dataset.plan.config_of(dataset.plan.trial(trial))
        distance = flight_residual(samples, header, config=config)
        if distance is not None:
            distances.append(distance)
    return Residuals(len(trials), len(chosen), np.array(distances))


def choose_examples(dataset: Dataset, landed: Landings, outcomes: Outcomes) -> tuple[int, ...]:
    """Choose trials to look at: some that landed, from the nearest to the farthest, and one of some other outcomes."""
    recorded = set(dataset.recorded.throws["trial"].to_pylist())
    by_distance = landed.trial[np.argsort(landed.distance_m, kind="stable")].tolist()
    usable = [trial for trial in by_distance if trial in recorded]
    picks = np.linspace(0, len(usable) - 1, min(len(usable), _MOST_LANDED)).round().astype(int)
    numbers = dataset["trial"]
    others = (
        next((trial for trial in numbers[outcomes.are(name)].tolist() if trial in recorded), None)
        for name in outcomes.names
        if name != LANDED
    )
    return (*(usable[pick] for pick in picks), *[trial for trial in others if trial is not None][:_MOST_OTHERS])


def read_paths(dataset: Dataset, trials: Sequence[int]) -> Iterator[BallPath]:
    """Read paths of the ball."""
    outcomes = dict(zip(dataset.throws["trial"].to_pylist(), dataset.throws["outcome"].to_pylist(), strict=True))
    for trial in trials:
        header, samples = read_samples(dataset, trial)
        release_ns = _find_release(header, dataset.config)
        release = None if release_ns is None else int(np.searchsorted(samples.stamps_ns, release_ns))
        yield BallPath(trial, outcomes[trial], samples.ball_position, release)


def read_motion(dataset: Dataset, trial: int) -> JointMotion:
    """Read the commanded and measured motion of one throw."""
    header, samples = read_samples(dataset, trial)
    config = dataset.plan.config_of(dataset.plan.trial(trial))
    trajectory = trajectory_of(config)
    times = samples.seconds_since(header.start_ns)
    columns = [dataset.joints.index(joint) for joint in trajectory.joints]
    release_ns = _find_release(header, config)
    return JointMotion(
        trial=trial,
        joints=trajectory.joints,
        times_s=times,
        commanded=sample_positions(trajectory, times),
        measured=samples.position[:, columns],
        release_s=None if release_ns is None else header.seconds_at(release_ns),
    )


def _find_release(header: EpisodeHeader, config: Config) -> int | None:
    gap_s = throw_section(config.task).recatch_gap_s
    return release_of(header.contacts, tool=config.tool.name, gap_s=gap_s)
