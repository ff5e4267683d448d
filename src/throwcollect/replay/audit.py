"""Replays many throws of a dataset in several processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from throwcollect.dataset.reader import Dataset
from throwcollect.engine_packages import require_engine
from throwcollect.errors import DatasetError
from throwcollect.extras import require
from throwcollect.replay.comparison import Comparison, compare
from throwcollect.side_by_side import THROWS_A_START, count_cores, work_side_by_side
from throwcollect.trial.choice import choose_trials


def select_trials(dataset: Dataset, *, sample: int | None) -> list[int]:
    """List the trials that have an episode, in order; or so many of them, always the same random choice.

    Raises:
        DatasetError: If no trial has an episode.
    """
    trials = [row["trial"] for row in dataset.throws.select(["trial", "shard"]).to_pylist() if row["shard"]]
    if not trials:
        raise DatasetError(f"{dataset.directory}: no trial has an episode")
    return trials if sample is None else choose_trials(trials, count=sample, seed=dataset.config.seed)


def replay_throws(directory: Path, trials: Sequence[int]) -> Iterator[Comparison]:
    """Simulate stored throws again, many of them on all cores, and compare them, in the given order.

    Args:
        directory: Directory of the dataset.
        trials: Trials that have an episode.

    Raises:
        DatasetError: If an episode is damaged.
        MissingExtraError: If a library for simulating is not installed.
        WorkerError: If the physics engine does not start.
    """
    require_engine(Dataset.open(directory).config.sim.engine)
    require("pinocchio")
    yield from work_side_by_side(
        trials, _begin, (directory,), processes=count_cores(), doing="simulates", worth=THROWS_A_START
    )


def _begin(directory: Path) -> Callable[[int], Comparison]:
    """Open dataset and simulation in a process, which keeps both from one trial to the next."""
    # Datasets are verified without the extra `collect`, too, which this import takes.
    from throwcollect.replay.throw import Replayer

    dataset = Dataset.open(directory)
    replayer = Replayer(dataset.config)
    return lambda trial: compare(dataset.episode(trial), replayer.run(dataset.plan.trial(trial)))
