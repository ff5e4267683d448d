"""Simulates many throws of a dataset again in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import DatasetError
from throwcollect.extras import require, require_engine
from throwcollect.progress_log import log_progress
from throwcollect.replay.comparison import Comparison, compare
from throwcollect.side_by_side import count_cores, limit_processes, work_side_by_side
from throwcollect.trial.choice import choose_trials

_Found = TypeVar("_Found")


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
