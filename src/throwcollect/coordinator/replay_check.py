"""Simulates some trials again in a fresh process, before a collection counts as finished."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from throwcollect.dataset.throws_table import Row
from throwcollect.errors import DatasetError, WorkerError
from throwcollect.interruption import die_with_parent
from throwcollect.own_process import make_command
from throwcollect.trial.choice import choose_trials
from throwcollect.wording import format_count


class ReplayCheck:
    """Compares trials with those that a fresh process simulates, which knows nothing but configuration and plan.

    Such a process takes a second before its first trial. So it may start while simulations still run the last trials,
    with a guess at which trials will be chosen. Which trials are compared in the end does not depend on that guess.

    Attributes:
        begun: Whether `begin` has been called.

    Args:
        count: How many trials are simulated again.
        seed: Root seed of the collection, by which they are chosen.
    """

    def __init__(self, directory: Path, *, count: int, seed: int) -> None:
        self._directory = directory
        self._count = count
        self._seed = seed
        self.begun = False
        self._early: _Process | None = None

    def begin(self, trials: Sequence[int]) -> None:
        """Start to simulate the trials that will be chosen if all of these, the trials of the plan, get an episode."""
        self.begun = True
        if chosen := choose_trials(trials, count=self._count, seed=self._seed):
            self._early = _Process(self._directory, chosen)

    def compare(self, rows: Mapping[int, Row], *, meanwhile: Callable[[], None]) -> str | None:
        """Compare episodes and results of some trials, and return a sentence on that; None if there are no trials.

        Args:
            rows: Row of each trial that has an episode, in order of trials.
            meanwhile: Is called again and again while a process works.
        """
        # The choice is made by place in the list, so the order must not depend on which episode came first.
        trials = choose_trials(list(rows), count=self._count, seed=self._seed)
        again: dict[int, Row] = {}
        if self._early is not None:
            # If the guess was wrong, do not wait for the process: a trial that was lost may never end there, either.
            if self._early.trials == trials:
                self._early.wait(meanwhile)
            self._early.end()
            again = dict(self._early.results)
        if missing := [trial for trial in trials if trial not in again]:
            again |= _simulate(self._directory, missing, meanwhile)
        wrong = {trial: sentence for trial in trials if (sentence := _find_difference(rows[trial], again[trial]))}
        if wrong:
            counted = f"{len(wrong)} of {format_count(len(trials), 'trial')}"
            raise DatasetError(
                f"{self._directory}: {counted} came out differently in a fresh process: "
                f"trial {', '.join(map(str, wrong))}",
                evidence="\n".join(f"trial {trial}: {sentence}" for trial, sentence in wrong.items()),
                hint="this machine, or a package that adds an engine or a task, does not compute the same each time, "
                "or something has changed what was simulated",
            )
        if not trials:
            return None
        return f"{format_count(len(trials), 'trial')} simulated again in a fresh process: the same bit for bit"

    def close(self) -> None:
        """End the process, if one runs."""
        if self._early is not None:
            self._early.end()


class _Process:
    """A process that simulates trials and prints for each the columns of its row that follow from the simulation.

    Attributes:
        results: Values of these columns, by trial and column; empty until `end`.
        errors: Text of its standard error; empty until `end`.
        exit_code: Its exit code; None until `end`.
    """

    def __init__(self, directory: Path, trials: Sequence[int]) -> None:
        self.trials = trials
        self.results: dict[int, Row] = {}
        self.errors = ""
        self.exit_code: int | None = None
        # Files instead of pipes, because nobody reads while it works, and a full pipe would stop it.
        self._stdout, self._stderr = TemporaryFile(), TemporaryFile()  # noqa: SIM115 - closed at its end
        self._process = subprocess.Popen(
            [*make_command(), "simulate", str(directory), *map(str, trials)],
            stdin=subprocess.DEVNULL,
            stdout=self._stdout,
            stderr=self._stderr,
            # Ctrl-C reaches only the process of this object, which then ends the new one.
            start_new_session=True,
            preexec_fn=partial(die_with_parent, os.getpid()),  # noqa: PLW1509 - it calls nothing that takes a lock
        )

    def wait(self, meanwhile: Callable[[], None]) -> None:
        """Wait until the process has simulated all trials, or has ended."""
        while self._process.poll() is None and _read_contents(self._stdout).count("\n") < len(self.trials):
            meanwhile()

    def end(self) -> None:
        """Kill it; a second call does no harm."""
        # Ending by itself would take the process time, and everything that is needed from it is in the files.
        self._process.kill()
        self.exit_code = self._process.wait()
        if not self._stdout.closed:
            with self._stdout, self._stderr:
                lines = _read_contents(self._stdout).splitlines(keepends=True)
                self.errors = _read_contents(self._stderr).strip()
            # The kill may have cut off the last line.
            whole = (json.loads(line) for line in lines if line[-1] == "\n")
            self.results = {printed["trial"]: printed for printed in whole}


def _simulate(directory: Path, trials: Sequence[int], meanwhile: Callable[[], None]) -> Mapping[int, Row]:
    """Simulate trials in a fresh process, and return the columns that follow from the simulation, by trial."""
    process = _Process(directory, trials)
    try:
        process.wait(meanwhile)
    finally:
        process.end()
    if len(process.results) < len(trials):
        counted = format_count(len(trials), "trial")
        raise WorkerError(
            f"{counted} could not be simulated again (exit code {process.exit_code})", evidence=process.errors or None
        )
    return process.results


def _find_difference(row: Row, again: Row) -> str | None:
    """Say which column of a row came out otherwise, beginning with the episode's digest; None if none did."""
    for column in sorted(again, key=lambda column: column != "digest"):
        if again[column] != row[column]:
            return f"{column} is {row[column]} in the dataset, {again[column]} in the fresh process"
    return None


def _read_contents(file: IO[bytes]) -> str:
    # The process shares the file's position and writes there, so read without moving it.
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode(errors="replace")
