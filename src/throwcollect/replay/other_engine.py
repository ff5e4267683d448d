"""Simulates stored throws with another physics engine, and tells how much depends on the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.engine_packages import require_engine
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.members import names_of
from throwcollect.replay.throw import Replayer
from throwcollect.side_by_side import count_cores, work_side_by_side

LANDING = ("landing_x_m", "landing_y_m")
"""Columns of where a throw landed."""


@dataclass(frozen=True)
class Deviation:
    """A throw by another engine beside the stored one.

    Attributes:
        trial: Number of the trial.
        stored: Its outcome in the dataset.
        again: Its outcome by the other engine.
        values: By column of the table of throws, what the other engine's value is above the stored one, in the unit of
            the column; columns that both throws have a number in.
    """

    trial: int
    stored: str
    again: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Distribution:
    """How much a column differs, in its unit.

    Attributes:
        column: Its name.
        throws: In how many throws it could be compared.
        mean: Mean difference, with its sign.
        rms: Root mean square.
        median: Median of the absolute differences.
        largest: Largest absolute difference.
    """

    column: str
    throws: int
    mean: float
    rms: float
    median: float
    largest: float


def simulate_with(directory: Path, engine: str, trials: Sequence[int]) -> Iterator[Deviation]:
    """Simulate stored throws with another engine, on all cores.

    Args:
        directory: Directory of the dataset.
        engine: Name of the engine.
        trials: Trials that have an episode.

    Yields:
        One deviation for each, in the given order.

    Raises:
        ConfigError: If there is no such engine, or the dataset was computed by it.
        DatasetError: If the dataset cannot be read.
        MissingExtraError: If what simulates is not installed.
        WorkerError: If the physics engine does not start.
    """
    own = Dataset.open(directory).config.sim.engine
    others = [name for name in names_of("engines") if name != own]
    if engine not in others:
        problem = f"the throws of {directory} are by {own} themselves" if engine == own else "there is no such engine"
        raise ConfigError(f"--engine {engine}: {problem}", expected=", ".join(others))
    require_engine(engine)
    require("pinocchio")
    return work_side_by_side(trials, _begin, (directory, engine), processes=count_cores(), doing="simulates")


def distributions(deviations: Sequence[Deviation]) -> list[Distribution]:
    """How much each column differs, in the order of the table."""
    found = []
    for column in dict.fromkeys(column for each in deviations for column in each.values):
        values = np.array([each.values[column] for each in deviations if column in each.values])
        sizes = np.abs(values)
        rms = float(np.sqrt(np.mean(values**2)))
        found.append(
            Distribution(column, len(values), float(values.mean()), rms, float(np.median(sizes)), float(sizes.max()))
        )
    return found


class _Kept:
    """What a process keeps from one trial to the next."""

    def __init__(self, directory: Path, engine: str) -> None:
        self.dataset = Dataset.open(directory)
        config = self.dataset.config
        self.config: Config = config.model_copy(update={"sim": config.sim.model_copy(update={"engine": engine})})
        plan = self.dataset.plan
        self.table = ThrowsTable(plan.keys, self.config, plan.trials.target_names)
        self.replayer = Replayer(self.config)
        self.stored = {row["trial"]: row for row in self.dataset.throws.to_pylist()}

    def simulate(self, number: int) -> Deviation:
        """Simulate a trial, and compare its row with the stored one."""
        trial = self.dataset.plan.trial(number)
        result = judge_episode(with_values(self.config, trial.values), self.replayer.run(trial))
        stored, again = self.stored[number], self.table.row(trial, result, None)
        # Counts and times come as they are; names, and what only one of both has, cannot be compared.
        compared = [
            column
            for column in again
            if column not in ("trial", *trial.values, *trial.target)
            and all(isinstance(row.get(column), int | float) for row in (stored, again))
        ]
        values = {column: float(again[column]) - float(stored[column]) for column in compared}
        return Deviation(number, stored["outcome"], again["outcome"], values)


def _begin(directory: Path, engine: str) -> Callable[[int], Deviation]:
    return _Kept(directory, engine).simulate
