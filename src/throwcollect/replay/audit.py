"""Replays many throws of a dataset in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from throwcollect.dataset.reader import Dataset
from throwcollect.engine_packages import require_engine
from throwcollect.errors import DatasetError
from throwcollect.extras import require
from throwcollect.replay.comparison import Comparison, compare
from throwcollect.side_by_side import count_cores, work_side_by_side
from throwcollect.trial.choice import choose_trials


def select_trials(dataset: Dataset, *, sample: int | None) -> list[int]:
    """Trials that have an episode, in order; of these, if asked for, a random choice that is always the same.

    Args:
        dataset: The dataset.
        sample: How many; None for all.

    Raises:
        DatasetError: If no trial has an episode.
    """
    trials = [row["trial"] for row in dataset.throws.select(["trial", "shard"]).to_pylist() if row["shard"]]
    if not trials:
        raise DatasetError(f"{dataset.directory}: no trial has an episode")
    return trials if sample is None else choose_trials(trials, count=sample, seed=dataset.config.seed)


def replay_throws(directory: Path, trials: Sequence[int]) -> Iterator[Comparison]:
    """Simulate stored throws again, on all cores, and compare them.

    Args:
        directory: Directory of the dataset.
        trials: Trials that have an episode.

    Yields:
        One comparison for each, in the given order.

    Raises:
        DatasetError: If an episode is damaged.
        MissingExtraError: If what simulates is not installed.
        WorkerError: If the physics engine does not start.
    """
    require_engine(Dataset.open(directory).config.sim.engine)
    require("pinocchio")
    yield from work_side_by_side(trials, _begin, (directory,), processes=count_cores(), doing="simulates")


class _Kept:
    """What a process keeps from one trial to the next."""

    def __init__(self, directory: Path) -> None:
        from throwcollect.replay.throw import Replayer

        self.dataset = Dataset.open(directory)
        self.replayer = Replayer(self.dataset.config)

    def replay(self, trial: int) -> Comparison:
        """Simulate a trial again, and compare."""
        return compare(self.dataset.episode(trial), self.replayer.run(self.dataset.plan.trial(trial)))


def _begin(directory: Path) -> Callable[[int], Comparison]:
    return _Kept(directory).replay
