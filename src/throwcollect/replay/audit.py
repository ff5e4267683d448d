"""Simulates throws of a dataset again, in several processes, and finds the differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from throwcollect.dataset.reader import Dataset
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.extras import require, require_engine
from throwcollect.progress_log import log_progress
from throwcollect.side_by_side import count_cores, limit_processes, work_side_by_side
from throwcollect.sweep.trials import choose_trials

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Comparison:
    """How a stored throw differs from the same throw, simulated again: a sentence for each difference.

    There are no differences if the episodes, whose digests are here, too, are the same bit for bit.
    """

    trial: int
    stored: str
    again: str
    differences: tuple[str, ...]


def select_trials(dataset: Dataset, *, sample: int | None) -> list[int]:
    """List the trials that have an episode, in order; with `sample`, only that many, always the same random choice."""
    trials: list[int] = dataset.recorded.throws["trial"].to_pylist()
    if not trials:
        raise DatasetError(f"{dataset.directory}: no trial has an episode")
    return trials if sample is None else choose_trials(trials, count=sample, seed=dataset.config.seed)


def replay_throws(directory: Path, trials: Sequence[int]) -> Iterator[Comparison]:
    """Simulate stored throws of a dataset again, and compare them, in the given order."""
    return simulate_side_by_side(Dataset.open(directory).config.sim.engine, trials, _begin, (directory,))


def simulate_side_by_side(
    engine: str, trials: Sequence[int], begin: Callable[..., Callable[[int], _Found]], arguments: tuple[object, ...]
) -> Iterator[_Found]:
    """Simulate trials by an engine on all cores; `begin` and its arguments are those of `work_side_by_side`."""
    require_simulating(engine)
    processes = limit_processes(count_cores(), len(trials))
    simulated = work_side_by_side(trials, begin, arguments, processes=processes, doing="simulates")
    return log_progress(simulated, len(trials), "throw", "simulated")


def require_simulating(engine: str) -> None:
    """Check that the libraries for simulating by an engine are installed, before anything begins."""
    require_engine(engine)
    require("pinocchio")


def _begin(directory: Path) -> Callable[[int], Comparison]:
    """Open dataset and simulation in a process, which keeps both from one trial to the next."""
    # This import needs the extra `collect`, but datasets can be verified without it.
    from throwcollect.sim.simulator import Simulator

    dataset = Dataset.open(directory)
    simulator = Simulator(dataset.config)

    def replay(number: int) -> Comparison:
        """Simulate a trial, and compare it with the stored one."""
        # A merged dataset has numbers of its own, and episodes those of their own plans.
        trial = replace(dataset.plan.trial(number), number=number - dataset.plan.first_of_part(number))
        again = simulator.run(trial)
        stored = dataset.throw(number)
        with stored.locating_damage():
            return replace(compare(stored.read_episode(), again), trial=number)

    return replay


def compare(stored: Episode, again: Episode) -> Comparison:
    """Compare two episodes of one trial."""
    stored.chunk.check_records()
    differences: tuple[str, ...] = ()
    # This compares contents and not chunks, as the same messages may be compressed in different ways.
    if (stored.chunk.contents, stored.header_json) != (again.chunk.contents, again.header_json):
        differences = tuple(_find_differences(stored, again)) or ("other channels than joint states and ball differ",)
    return Comparison(stored.header.trial, stored.digest, again.digest, differences)


def _find_differences(stored: Episode, again: Episode) -> Iterator[str]:
    for field in fields(EpisodeHeader):
        before, now = getattr(stored.header, field.name), getattr(again.header, field.name)
        if before != now:
            yield f"{field.name}: {before} stored, {now} now"
    one, other = stored.samples(again.table.joints), again.samples()
    count = min(len(one), len(other))
    for column in fields(Samples):
        before, now = getattr(one, column.name)[:count], getattr(other, column.name)[:count]
        rows = np.flatnonzero((before != now).reshape(count, -1).any(axis=1))
        if len(rows):
            largest = np.abs(before.astype(np.float64) - now).max()
            time_s = (one.stamps_ns[rows[0]] - one.stamps_ns[0]) / 1e9
            yield f"{column.name}: from {time_s:.3f} s on, by up to {largest:.3g}"
