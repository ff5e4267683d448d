"""Simulates some trials again in a fresh process, before a collection counts as finished."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.directory import CONFIG, PLAN
from throwcollect.dataset.throws_table import Row, find_row
from throwcollect.errors import DatasetError
from throwcollect.plan.plan import Plan
from throwcollect.plan.trials import choose_trials
from throwcollect.side_by_side import Workers
from throwcollect.wording import format_count

if TYPE_CHECKING:
    from concurrent.futures import Future


class ReplayCheck:
    """Compares trials with those that a fresh process simulates, which knows nothing but configuration and plan.

    Such a process takes a second before its first trial. So it may start while simulations still run the last trials,
    with a guess at which trials will be chosen. Which trials are compared in the end does not depend on that guess.

    Attributes:
        begun: Whether `begin` has been called.

    Args:
        directory: Directory of the dataset.
        config: Its configuration, which has the number of trials that are simulated again.
    """

    def __init__(self, directory: Path, config: Config) -> None:
        self._directory = directory
        self._policy = config.task.policy
        count = config.run.replay if self._policy is None or self._policy.reproducible else 0
        self._choose = partial(choose_trials, count=count, seed=config.seed)
        self.begun = False
        self._again: dict[int, Future[Row]] = {}
        self._held = ExitStack()

    def begin(self, trials: Sequence[int]) -> None:
        """Start to simulate the trials that will be chosen if all of these, the trials of the plan, get an episode."""
        self.begun = True
        self._simulate(self._choose(trials))

    def compare(self, throws: pa.Table, *, meanwhile: Callable[[], None]) -> str | None:
        """Compare episodes and results of some trials, and return a sentence on that; None if there are no trials.

        Args:
            throws: The table of throws.
            meanwhile: Is called again and again while a process works.
        """
        # The choice is made by place in the list, so the order must not depend on which episode came first.
        recorded = throws["trial"].filter(throws["digest"].is_valid()).to_pylist()
        trials = self._choose(recorded)
        if list(self._again) != trials:
            # If the guess was wrong, do not wait: a trial that was lost may never end in that process, either.
            self._simulate(trials)
        while not all(future.done() for future in self._again.values()):
            meanwhile()
        again = {trial: self._workers.wait(future) for trial, future in self._again.items()}
        self.close()
        pairs = {trial: (find_row(throws, trial) or {}, again[trial]) for trial in trials}
        wrong = {trial: sentence for trial, pair in pairs.items() if (sentence := _find_difference(*pair))}
        if wrong:
            counted = f"{len(wrong)} of {format_count(len(trials), 'trial')}"
            hint = (
                "this machine, or a package that adds an engine or a task, does not compute the same each time, "
                "or something has changed what was simulated"
            )
            if self._policy:
                hint = (
                    f"the policy {self._policy.use} is not a function of its seed and its observations: it should draw "
                    "random numbers by the seed of `reset` alone, and keep nothing from an earlier trial; "
                    "task.policy.reproducible: false collects with it as it is"
                )
            raise DatasetError(
                f"{self._directory}: {counted} came out differently in a fresh process: "
                f"trial {', '.join(map(str, wrong))}",
                evidence="\n".join(f"trial {trial}: {sentence}" for trial, sentence in wrong.items()),
                hint=hint,
            )
        if not trials:
            return None
        return f"{format_count(len(trials), 'trial')} simulated again in a fresh process: the same bit for bit"

    def close(self) -> None:
        """End the process, if one runs."""
        self._held.close()

    def _simulate(self, trials: Sequence[int]) -> None:
        """Start a new process that simulates these trials, in order; the one before ends."""
        self.close()
        self._again = {}
        if trials:
            self._workers = Workers(_begin, (self._directory,), processes=1, doing="simulates trials again")
            self._held.callback(self._workers.close)
            self._again = dict(zip(trials, self._workers.submit(trials), strict=True))


def _begin(directory: Path) -> Callable[[int], Row]:
    """Make the function that simulates a trial of the plan: digest of its episode, and columns of its result."""
    from throwcollect.sim.simulator import Simulator

    plan = Plan.read(directory / PLAN, load(directory / CONFIG))
    simulator = Simulator(plan.config)

    def simulate(trial: int) -> Row:
        episode = simulator.run(plan.trial(trial))
        return {"digest": episode.digest, **json.loads(episode.result)}

    return simulate


def _find_difference(row: Row, again: Row) -> str | None:
    """Find the column of a row that came out otherwise, beginning with the episode's digest; None if none did."""
    for column in sorted(again, key=lambda column: column != "digest"):
        if again[column] != row[column]:
            return f"{column} is {row[column]} in the dataset, {again[column]} in the fresh process"
    return None
