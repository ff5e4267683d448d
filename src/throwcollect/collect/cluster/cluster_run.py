"""Follows a submitted dataset, by its files and by the queue of the scheduler."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from throwcollect.collect.cluster import slurm
from throwcollect.collect.cluster.slurm import ArrayTask
from throwcollect.collect.cluster.submission import CLUSTER, LOGS, Submission, read_submission
from throwcollect.collect.coordinator.progress import Progress, TrialRate
from throwcollect.config.schema import Config
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import METADATA, PLAN, THROWS
from throwcollect.dataset.slices import find_finished, slice_directory
from throwcollect.errors import Interrupted, ThrowcollectError, WorkerError
from throwcollect.plan.parquet_file import read_parquet
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice
from throwcollect.tasks.result import REFUSED
from throwcollect.wording import command, format_count, join_names

_POLL_S = 2.0
_MOST_NAMED = 5


@dataclass(frozen=True)
class ClusterRun:
    """A dataset that was submitted to a scheduler, with the record of its submission."""

    directory: Path
    submission: Submission

    @classmethod
    def open(cls, directory: Path) -> ClusterRun:
        """Open the run of a dataset."""
        return cls(directory, read_submission(directory))

    @cached_property
    def config(self) -> Config:
        """Configuration of the dataset."""
        return read_config(self.directory)

    @cached_property
    def trials(self) -> int:
        """Number of trials of the plan that are run."""
        trials = Plan.read(self.directory / PLAN, self.config).trials
        return len(trials) - len(trials.refused)

    def look(self) -> SlicesState:
        """Look at the queue and the files."""
        # Ask the queue before the files are read: a task puts its slice into place before it leaves the queue.
        queue = slurm.find_tasks()
        tasks: dict[int | None, ArrayTask] = {}
        joining: ArrayTask | None = None
        for job in self.submission.jobs:
            tasks |= {task.index: task for task in queue.get(job.array, ())}
            joining = next(iter(queue.get(job.join, ())), joining)
        complete = (self.directory / METADATA).exists()
        finished = frozenset(self.submission.slices) if complete else find_finished(self.directory)
        return SlicesState(finished, tuple(tasks.values()), joining, complete)

    def stop(self) -> None:
        """End all jobs: tasks shut down properly, and keep the episodes that they have."""
        slurm.cancel([job for each in self.submission.jobs for job in (each.array, each.join) if job])

    def explain(self, look: SlicesState) -> ThrowcollectError | None:
        """Make the error that explains why a run that has ended has no finished dataset; None if it has one."""
        if look.complete:
            return None
        again = command("resume", self.directory)
        missing = [each for each in self.submission.slices if each not in look.finished]
        if not missing:
            hint = f"{command('join', self.directory)} joins them"
            return WorkerError("all slices are finished, but they are not joined", hint=hint)
        ended = {task.index: task for task in look.tasks if not task.lives}
        reasons = [self._explain_slice(each, ended.get(each.index)) for each in missing[:_MOST_NAMED]]
        more = f" and {len(missing) - _MOST_NAMED} more" if len(missing) > _MOST_NAMED else ""
        message = f"{format_count(len(missing), 'slice')} of {self.submission.tasks} not collected: "
        if all(self._is_cancelled(each, ended.get(each.index)) for each in missing):
            return Interrupted(f"{message}cancelled", hint=f"{again} submits what is missing")
        return WorkerError(f"{message}{join_names(reasons)}{more}", hint=f"{again} submits what is missing")

    @property
    def logs(self) -> dict[str, Path]:
        """The latest log of each task, by its index."""
        found = {str(index): self.log(index) for index in range(self.submission.tasks)}
        return {index: path for index, path in found.items() if path is not None}

    def log(self, index: int) -> Path | None:
        """Find the latest log of a task of an array; None if it has written none."""
        logs = self.directory / CLUSTER / LOGS
        found = [path for job in self.submission.jobs if (path := logs / f"{job.array}_{index}.log").exists()]
        return found[-1] if found else None

    def _is_cancelled(self, slice: Slice, task: ArrayTask | None) -> bool:
        # Slurm forgets tasks that were cancelled before they began.
        return self.log(slice.index) is None if task is None else task.state == "CANCELLED"

    def _explain_slice(self, slice: Slice, task: ArrayTask | None) -> str:
        if task is None:
            return f"{slice.index}"
        if task.saw_no_directory:
            return f"{slice.index} (node {task.node} does not see {self.directory})"
        return f"{slice.index} ({task.state}, {task.reason}, node {task.node or '-'})"


@dataclass(frozen=True)
class SlicesState:
    """The state of a submitted dataset at one time.

    Attributes:
        finished: Slices that are finished.
        tasks: Tasks of its arrays that Slurm remembers.
        joining: The job that joins the slices; None if Slurm has forgotten it.
        complete: Whether the dataset is finished.
    """

    finished: frozenset[Slice]
    tasks: tuple[ArrayTask, ...]
    joining: ArrayTask | None
    complete: bool

    @property
    def running(self) -> int:
        """Number of tasks that run."""
        return sum(task.runs for task in self.tasks)

    @property
    def lives(self) -> bool:
        """Whether a job of the dataset runs, or waits to run."""
        # With this reason a job waits for ever, as the job that it depends on can no longer end as it should.
        joins = self.joining is not None and self.joining.lives and self.joining.reason != "DependencyNeverSatisfied"
        return any(task.lives for task in self.tasks) or joins


class ProgressOfSlices:
    """Counts the trials of finished slices, and reads each slice only once.

    The speed is measured from the first look on, as no file has how fast trials ended before.
    """

    def __init__(self, run: ClusterRun) -> None:
        self._run = run
        self._rate: TrialRate | None = None
        self._outcomes: Counter[str] = Counter()
        self._read: set[Slice] = set()

    def at(self, look: SlicesState) -> Progress:
        """Count the trials that have ended."""
        directory = self._run.directory
        if look.complete:
            self._outcomes = _count_outcomes(directory)
        else:
            for each in look.finished - self._read:
                try:
                    self._outcomes += _count_outcomes(slice_directory(directory, each))
                except ThrowcollectError:
                    continue  # a join moves the files of slices
                self._read.add(each)
        task, ended = self._run.config.task, self._outcomes.total()
        self._rate = self._rate or TrialRate(ended, window_s=math.inf)
        self._rate.note(ended)
        return Progress(
            total=self._run.trials,
            ended=ended,
            outcomes=dict(self._outcomes),
            simulations=look.running * self._run.config.cluster.cores,
            throws_per_s=self._rate.per_s,
            hung=[],
            success=task.success,
            noun=task.noun,
        )


def _count_outcomes(directory: Path) -> Counter[str]:
    """Count the trials of each outcome in a finished dataset or slice, without those that the plan refuses."""
    return Counter(each for each in read_parquet(directory / THROWS)["outcome"].to_pylist() if each != REFUSED)


def follow(run: ClusterRun, *, keep_on: Callable[[], bool] = lambda: True) -> Iterator[SlicesState]:
    """Look at a run every few seconds, until it has ended or `keep_on` returns False.

    Yields:
        The state of the run; the last one is the state after its end, unless `keep_on` has returned False.
    """
    while True:
        look = run.look()
        yield look
        if look.complete or not look.lives or not keep_on():
            return
        time.sleep(_POLL_S)
