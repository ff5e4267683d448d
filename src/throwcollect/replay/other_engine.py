"""Simulates stored throws with another physics engine, and measures how much depends on the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from throwcollect.config.values import column_of, with_values
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.errors import ConfigError
from throwcollect.members import names_of
from throwcollect.replay.audit import simulate_side_by_side
from throwcollect.sim.simulator import Simulator
from throwcollect.wording import join_names, suggest


@dataclass(frozen=True)
class Deviation:
    """How a throw by another engine differs from the stored one.

    Attributes:
        stored: Its outcome in the dataset.
        again: Its outcome by the other engine.
        values: The other engine's value minus the stored one, in the unit of the column, for each column of the table
            of throws in which both throws have a number.
    """

    trial: int
    stored: str
    again: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Distribution:
    """How much a column differs in the throws in which it could be compared, in its unit.

    The mean is that of differences with their signs; median and largest are those of absolute differences.
    """

    column: str
    throws: int
    mean: float
    rms: float
    median: float
    largest: float


def simulate_with(directory: Path, engine: str, trials: Sequence[int]) -> Iterator[Deviation]:
    """Simulate stored throws of a dataset with another engine; deviations come in the given order."""
    own = Dataset.open(directory).config.sim.engine
    others = [name for name in names_of("engines") if name != own]
    if engine == own:
        problem = f"--engine {engine}: the throws of {directory} are by {own} themselves"
        raise ConfigError(problem, expected=join_names(others, "or"))
    if engine not in others:
        raise ConfigError(f"--engine {engine}: there is no such engine{suggest(engine, others)}")
    return simulate_side_by_side(engine, trials, _begin, (directory, engine))


def distributions(deviations: Sequence[Deviation]) -> list[Distribution]:
    """Sum up how much each column differs, in the order of the table."""
    found = []
    for column in dict.fromkeys(column for each in deviations for column in each.values):
        values = np.array([each.values[column] for each in deviations if column in each.values])
        sizes = np.abs(values)
        rms = float(np.sqrt(np.mean(values**2)))
        found.append(
            Distribution(column, len(values), float(values.mean()), rms, float(np.median(sizes)), float(sizes.max()))
        )
    return found


def _begin(directory: Path, engine: str) -> Callable[[int], Deviation]:
    """Open dataset and simulation in a process, which keeps both from one trial to the next."""
    dataset = Dataset.open(directory)
    plan, own = dataset.plan, dataset.config
    config = own.model_copy(update={"sim": own.sim.model_copy(update={"engine": engine})})
    table = ThrowsTable(plan.keys, config, plan.trials.target_names)
    simulator = Simulator(config)

    def simulate(number: int) -> Deviation:
        """Simulate a trial, and compare its row with the stored one."""
        trial = plan.trial(number)
        result = judge_episode(with_values(config, trial.values), simulator.run(trial))
        stored, again = dataset.select([number])[0].row, table.row(trial, result, None)
        # Columns of text, and numbers that only one of the two rows has, cannot be compared.
        compared = [
            column
            for column in again
            if column not in ("trial", *map(column_of, trial.values), *trial.target)
            and all(isinstance(row.get(column), int | float) for row in (stored, again))
        ]
        values = {column: float(again[column]) - float(stored[column]) for column in compared}
        return Deviation(number, stored["outcome"], again["outcome"], values)

    return simulate
