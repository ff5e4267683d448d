"""The trials of a plan on their way into the dataset, for any kind of simulation.

`TrialCollection` decides which trial a simulation gets next, whether an episode is the one that was asked for, and what
is written. It knows no network and no processes: the coordinator's node drives it with the simulations that it finds in
the ROS graph, and a run in one process drives it with a simulation of its own.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

from throwcollect.collect.coordinator.leases import Leases, Prefix
from throwcollect.collect.coordinator.prefetch import Prefetch
from throwcollect.collect.coordinator.prepare import count_first, feasibility_check
from throwcollect.collect.coordinator.progress import Progress, TrialRate
from throwcollect.collect.coordinator.replay_check import ReplayCheck
from throwcollect.dataset.directory import find_known_directory
from throwcollect.dataset.summary import explain_loss
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError, Interrupted, WorkerError
from throwcollect.plan.conditions import Settings, explain_difference
from throwcollect.plan.plan import Check
from throwcollect.tasks.result import LOST, Result
from throwcollect.tasks.task import task_of, trajectory_of
from throwcollect.wording import command, format_count

_SYNC_EVERY_S = 1.0
"""Real time after which data is forced to the disk: a power cut costs what was collected in this time at most."""
_REPLAY_AHEAD_S = 3.0
"""How long before the expected end of the last trial the process starts that simulates some trials again."""


class TrialCollection:
    """The trials of one dataset; a context manager.

    A simulation is known by an address that is unique in the run (its ROS namespace), and named in the journal and in
    reports by its node's name.

    Attributes:
        writer: The dataset that is filled.
        warn: Called with a warning when a trial goes to another simulation; the coordinator's node sets it to its log.
        on_change: Called when the trials of simulations may have changed: there are new ones, or no further trial may
            begin.
    """

    def __init__(self, writer: DatasetWriter, directory: Path) -> None:
        self.writer = writer
        self.warn: Callable[[str], object] = lambda _: None
        self.on_change: Callable[[], None] = lambda: None
        self._config = writer.plan.config
        trials = writer.plan.trials
        wanted = self._config.until.wanted if self._config.until else None
        self._prefix = Prefix(trials.numbers, wanted=wanted, refused=trials.refused)
        self._next_to_check = trials.first + count_first(self._config, len(trials))
        """No trial from this one on has been checked, or leased."""
        self._check: Check | None = None
        checked = (number for number in trials.numbers_to_run if number < self._next_to_check)
        self._leases = Leases(checked, retries=self._config.run.retries)
        self._names: dict[str, str] = {}
        self._took_part: set[str] = set()
        self._settings = Settings(self._config)
        task = task_of(self._config)
        self._columns, self._outcome_names = task.columns, task.outcomes
        self._prefetch = Prefetch()
        self._agreed: set[str] = set()
        """Simulations that have handed over an episode whose motion was compared with that of the plan."""
        self._outcomes: Counter[str] = Counter()
        self._rate = TrialRate()
        self._draining = False
        self._drain_deadline = math.inf
        self._synced_at = time.monotonic()
        self._directory = directory
        self._replay = ReplayCheck(directory, self._config)

    @classmethod
    def open(cls, directory: Path, *, say: Callable[[str], object], processes: int = 1) -> TrialCollection:
        """Open a dataset to collect into, as `prepare` or `resume` left it, and count what is there already as done.

        `say` is called with how many episodes were found; `processes` is as `DatasetWriter.recover` takes it.
        """
        collection = cls(DatasetWriter.open(directory), directory)
        count = 0

        def count_episode(trial: int, result: Result) -> bool:
            nonlocal count
            count += 1
            return collection.recall(trial, result)

        try:
            if collection.writer.recover(count_episode, processes=processes):
                say(f"keeps {format_count(count, 'episode')} of an earlier collection")
        except BaseException:
            collection.writer.close()
            raise
        return collection

    def __enter__(self) -> TrialCollection:
        return self

    def __exit__(self, *_: object) -> None:
        self._replay.close()
        self.writer.close()

    @property
    def finished(self) -> bool:
        """Whether all trials have ended; while draining, whether running ones did, or time is up."""
        return self.complete or (
            self._draining and (self._leases.leased == 0 or time.monotonic() > self._drain_deadline)
        )

    @property
    def complete(self) -> bool:
        """Whether every trial that belongs to the dataset has ended."""
        return self._prefix.complete

    def drain(self) -> None:
        """Let no more trials begin; those that run have `run.grace_s` to end."""
        if not self._draining:
            self._draining = True
            self._drain_deadline = time.monotonic() + self._config.run.grace_s
            # Only the first trial that a simulation holds runs. The others go back, and `on_change` sends the new list.
            for simulation in self._names:
                self._leases.release(simulation)
            self.on_change()

    def recall(self, trial: int, result: Result) -> bool:
        """Count a trial as ended, as the dataset has its episode; call this in order of trials, before `lease`.

        Returns:
            Whether the trial certainly belongs to the dataset. It may not if an earlier trial was lost, which would
            succeed now; then it does not count, and is run again if it belongs to the dataset after all.
        """
        while self._next_to_check < min(trial, self._prefix.stop):
            self.check_next()
        if trial >= self._prefix.stop:
            return False
        if trial == self._next_to_check:
            self._next_to_check += 1
            self._leases.add([trial])
        self._leases.recall(trial)
        self._note(trial, result.outcome.value)
        self._rate = TrialRate(self._leases.ended)
        return True

    def join(self, simulation: str, name: str) -> None:
        """Note the address of a simulation that can be given trials, and the name of its node."""
        self._names[simulation] = name
        self._took_part.add(name)

    def leave(self, simulation: str, reason: str) -> None:
        """Forget a simulation that is out of sight, and take its trials back; call `settle` when its fate is known."""
        self.take_back(simulation, reason, alive=None)
        self._leases.forget(simulation)
        self._prefetch.forget(simulation)
        self._agreed.discard(simulation)
        del self._names[simulation]

    def settle(self, simulation: str, *, alive: bool) -> None:
        """Note what became of a simulation that has left: only if it was not alive has it failed with its trial."""
        if (given_up := self._leases.settle(simulation, alive=alive)) is not None:
            self._lose(*given_up)

    def lease(self, simulation: str) -> tuple[int, ...]:
        """Give further trials to a simulation that has few, and return all trials that it has to do, in order."""
        held = self._leases.find_held(simulation)
        count = self._prefetch.count_for(
            simulation, waiting=self._leases.waiting + len(held), simulations=len(self._names)
        )
        # A list is filled up when half of it is done, and not trial by trial: each request takes time of the one
        # process that all simulations wait for.
        if self._draining or len(held) > count // 2:
            return held
        # The time in which the simulation had nothing to do is no part of the next trial's duration.
        if not held:
            self._prefetch.begin(simulation)
        while len(held) < count and (trial := self._leases.lease(simulation, others=self._names)) is not None:
            self.writer.note("lease", trial=trial, simulation=self.name_of(simulation))
            held = (*held, trial)
        return held

    def take_in(self, simulation: str, episode: Episode) -> bool:
        """Write an episode; refuse one that is not what the plan asks for.

        The first episode of a trial counts, even if another simulation holds it by now, and further ones are dropped.

        Returns:
            Whether it was written.
        """
        trial = episode.header.trial
        if not self._leases.is_open(trial):
            return False
        try:
            result = self._columns.from_json(self._outcome_names, episode.result)
            reason = explain_difference(episode.conditions, self._expect(simulation, episode))
        except DatasetError as error:
            reason = error.message
        if reason is not None:
            self.refuse(simulation, trial, f"its episode is refused: {reason}")
            return False
        self._agreed.add(simulation)
        self._prefetch.end(simulation)
        for refuser in self._leases.complete(simulation, trial):
            self.warn(f"{refuser}: gets no more trials, because it refused trials that other simulations could do")
        self.writer.append(episode, result)
        self._note(trial, result["outcome"])
        return True

    def refuse(self, simulation: str, trial: int, reason: str) -> None:
        """Take back a trial that a simulation holds and could not do, or did otherwise; count that as its refusal."""
        if trial not in self._leases.find_held(simulation):
            return
        self._give_back(simulation, trial, reason, self._leases.fail(simulation, trial, reason, refused=True))

    def take_back(self, simulation: str, reason: str, *, refused: bool = False, alive: bool | None = False) -> None:
        """Take all trials back from a simulation, which failed with the first and had not begun the others.

        The reason is kept as evidence. With `refused`, the simulation refused the trials, and may refuse all others.
        If it is `alive`, this does not count; None if only a later call of `settle` decides it.
        """
        self._leases.release(simulation)
        for trial in self._leases.find_held(simulation):
            given_up = self._leases.fail(simulation, trial, reason, refused=refused, alive=alive)
            self._give_back(simulation, trial, reason, given_up)

    def check_next(self) -> bool:
        """Check whether the robot can do the next trial of the plan, which takes some milliseconds.

        Returns:
            False if no trial is left to check, as it is not certain that any further one belongs to the dataset.
        """
        number = self._next_to_check
        if self._draining or number >= self._prefix.stop:
            return False
        self._next_to_check += 1
        trials = self.writer.plan.trials
        if number not in trials.refused:
            self._check = self._check or feasibility_check(self._config)
            if (reason := self._check(self.writer.plan.config_of(trials[number]))) is None:
                self._leases.add([number])
                self.on_change()
                return True
            self.writer.refuse(number, reason)
        self._prefix.end(number, succeeded=False)
        return True

    def look_after(self) -> None:
        """Make what is written survive a power cut, once a second, and end a collection that cannot go on."""
        if (reason := self._leases.explain_hopelessness(self._names)) is not None:
            raise WorkerError("every simulation refuses its trials, and none was ever done", evidence=reason)
        if time.monotonic() >= self._synced_at + _SYNC_EVERY_S:
            self._synced_at = time.monotonic()
            self.writer.sync()
        remaining = self._leases.total - self._leases.ended
        # `begin` guesses from all trials of the plan. With `until`, it is not known which of them the dataset gets.
        settled = self._config.until is None and not self._draining
        if settled and not self._replay.begun and remaining <= _REPLAY_AHEAD_S * self._rate.per_s:
            self._replay.begin(list(self.writer.plan.trials.numbers_to_run))

    def progress(self, hung: Iterable[str] = ()) -> Progress:
        """Report how far the collection has come; `hung` names the simulations that took too long for a trial."""
        ended = self._leases.ended
        self._rate.note(ended)
        return Progress(
            total=self._leases.total,
            ended=ended,
            outcomes=dict(self._outcomes),
            simulations=len(self._names),
            throws_per_s=self._rate.per_s,
            hung=sorted(hung),
            wanted=self._config.until.wanted if self._config.until else None,
            success=self._config.task.success,
            noun=self._config.task.noun,
        )

    def finish(self, *, meanwhile: Callable[[], None], say: Callable[[str], object]) -> None:
        """Simulate some trials again in a fresh process, and write what describes the dataset as a whole.

        `meanwhile` is called again and again while that process works, and `say` with the result.
        """
        known = find_known_directory(self._directory)
        if not self.complete:
            raise Interrupted(
                f"interrupted; what is finished is in {known or 'the volume'}",
                hint=command("resume", known) if known else None,
            )
        if self._config.until is not None:
            self.writer.end_with(self._prefix.stop - 1)
        # The comparison comes first, because what is written next makes the dataset count as finished.
        if (sentence := self._replay.compare(self.writer.throws(), meanwhile=meanwhile)) is not None:
            say(sentence)
        outcomes = self.writer.finish(simulations=len(self._took_part) or None)
        lost = explain_loss(outcomes, hint=f"{command('resume', known)} runs them again" if known else None)
        if lost is not None:
            raise lost

    def name_of(self, simulation: str) -> str:
        """Find the name of a simulation's node, even after the simulation has left."""
        # By default, a simulation lives in a namespace that has the name of its node.
        return self._names.get(simulation, simulation.strip("/"))

    def _note(self, trial: int, outcome: str) -> None:
        self._outcomes[outcome] += 1
        self._prefix.end(trial, succeeded=outcome == self._config.task.success)

    def _expect(self, simulation: str, episode: Episode) -> str:
        """Write the conditions of an episode that the plan asks for.

        A simulation that has computed one motion as this process does, from the same sources, computes all alike. So
        this process works out only the first one of each simulation; replays compare some throws at the end.
        """
        plan, motion = self.writer.plan, episode.conditions.rpartition("\n")[2]
        trial = plan.trial(episode.header.trial)
        if simulation not in self._agreed:
            motion = trajectory_of(plan.config_of(trial)).digest
        return self._settings.conditions_of(trial.values, motion)

    def _give_back(self, simulation: str, trial: int, reason: str, given_up: list[str] | None) -> None:
        """Report a trial that is tried again, by another simulation if there is one, or record it as lost."""
        fate = "is tried again" if given_up is None else "is lost"
        self.warn(f"{simulation}: trial {trial} {fate}: {reason}")
        self.writer.note("fail", trial=trial, simulation=self.name_of(simulation), reason=reason)
        if given_up is not None:
            self._lose(trial, given_up)

    def _lose(self, trial: int, reasons: list[str]) -> None:
        self.writer.append_lost(trial, "; ".join(reasons))
        self._note(trial, LOST)
