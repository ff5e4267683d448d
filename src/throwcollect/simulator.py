"""Simulates throws of a configuration in this process, without nodes and files, but with the same bits."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from threading import RLock

import numpy as np

from throwcollect.collect.coordinator.prepare import feasibility_check
from throwcollect.config.loader import load
from throwcollect.config.motion import PolicyConfig
from throwcollect.config.schema import Config
from throwcollect.config.sweep import MOST_TRIALS
from throwcollect.config.task_config import LARGEST_TARGET
from throwcollect.config.values import reason_not_sweepable, with_values
from throwcollect.dataset.throw import Throw
from throwcollect.dataset.throws_table import ThrowsTable, judge_episode
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import ConfigError, ConflictError, PlanError, Problem, check_bounds, refuse_argument
from throwcollect.extras import require
from throwcollect.files import StrPath
from throwcollect.plan.chosen_motions import complete_point
from throwcollect.plan.plan import Check, make_trials
from throwcollect.plan.trials import Points, Trial
from throwcollect.side_by_side import work_side_by_side
from throwcollect.sim import simulator as sim
from throwcollect.sim.policy import Policy, check_observation

# If the extra is missing, importing `Simulator` fails with the hint on it, and not only the first throw.
require("pinocchio")

Point = Mapping[str, float]
"""Values that replace those of the configuration, by dotted key, in the key's unit."""


class Simulator:
    """Simulates throws of one configuration, one after the other, as a collection of it would.

    A throw has the samples, the events and the digest that a dataset of the same configuration has for the same values
    under the same number. The first throw takes about a second, because the robot is loaded, and each further throw
    less than a tenth of that.

    Use it as a context manager, or `close` it, because a process can have only a few physics engines at a time. Several
    threads may use one simulator: while it throws for one of them, the others wait.

    Args:
        config: YAML file of a configuration, or a `Config`, as `load_config` gives it; its sweep is not looked at.
        overrides: ``key=value`` pairs that win over the file, as ``--set`` takes them; none with a `Config`.

    Attributes:
        config: The resolved configuration.

    Raises:
        ConfigError: If the configuration is wrong, or does not describe a world.
        WorkerError: If the physics engine does not start.
    """

    def __init__(self, config: StrPath | Config, *, overrides: Sequence[str] = ()) -> None:
        if isinstance(config, Config):
            if overrides:
                raise refuse_argument(
                    "overrides", "win over a file, got a Config", hint="load_config(FILE, overrides) applies them"
                )
            self.config, self._source = config, config.name
        else:
            self.config, self._source = load(config, overrides), os.fspath(config)
        # A throw changes the robot's model and the world. A handler of a signal may close during a throw of its thread.
        self._lock = RLock()
        self._check = feasibility_check(self.config)
        self._simulator = sim.Simulator(self.config)

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the physics engine; nothing can be simulated afterwards. Closing it once more does nothing."""
        with self._lock:
            self._simulator.close()

    def throw(self, values: Point | None = None, *, trial: int = 0, target: Point | None = None) -> Throw:
        """Simulate one throw.

        Args:
            values: Values that differ from the configuration, of any keys that a sweep may vary, such as
                ``{"task.duration_s": 1.1}``.
            trial: Number of the trial, from 0. The clock of a later trial shows a later time, which is in the stamps
                and in the digest; nothing else depends on the number.
            target: Where the throw should end, such as ``{"target_x_m": 1.4, "target_y_m": -0.2}``; the throw then has
                its miss, and is the same otherwise.

        Returns:
            The throw, as `throwcollect.load` gives it; it is in no shard.

        Raises:
            ConfigError: If a key cannot vary, a value is out of its range, or the task has no such target.
            ConflictError: If the simulator is closed.
            PlanError: If the plan of a collection would refuse the throw; the error gives the plan's reason.
        """
        return self._run(self.config, None, values, trial=trial, target=target)

    def roll_out(
        self,
        policy: Policy,
        values: Point | None = None,
        *,
        trial: int = 0,
        target: Point | None = None,
        rate_hz: int = 50,
        command: str = "position",
        observation: Sequence[str] = (),
    ) -> Throw:
        """Let a policy command the joints in one trial, in the place of a planned motion.

        The first observation is that of the start state. A policy that plays back the commands of a throw, one for each
        physics step, gives the samples of that throw bit for bit.

        Args:
            policy: Has ``reset(seed, target)`` and ``act(observation)``; see `throwcollect.sim.policy.Policy`.
            values: As for `throw`; `task.end` only chooses the joints that move.
            trial: As for `throw`; the seed that the policy gets follows from it.
            target: As for `throw`; the policy gets it, too.
            rate_hz: Commands per simulated second; divides `sim.physics_hz`.
            command: What it commands: ``position`` [rad] or ``velocity`` [rad/s].
            observation: Arrays that it gets; empty for all that there are.

        Returns:
            The trial, as `throw` gives it. Its commands are recorded in ``/policy/command``.

        Raises:
            ConfigError: As `throw`, or an argument is wrong.
            ConflictError: If the simulator is closed.
            MemberError: If the policy raises an error, or gives a wrong command; the error names the time.
            PlanError: If the robot cannot rest in the start posture.
        """
        config = with_policy(self.config, policy, rate_hz=rate_hz, command=command, observation=observation)
        return self._run(config, policy, values, trial=trial, target=target)

    def _run(
        self, config: Config, policy: Policy | None, values: Point | None, *, trial: int, target: Point | None
    ) -> Throw:
        """Simulate one trial of a configuration that is this simulator's own, but for the policy; see `throw`."""
        check_bounds("trial", trial, least=0, most=MOST_TRIALS - 1)
        point, target = complete_point(values or {}, config), dict(target or {})
        wrong = config.task.find_wrong_targets(target)
        for name, value in target.items():
            if not abs(value) <= LARGEST_TARGET:
                wrong[name] = f"should be from {-LARGEST_TARGET:g} to {LARGEST_TARGET:g}, got {value}"
        if wrong:
            raise ConfigError([Problem(reason, key=name) for name, reason in wrong.items()])
        points = Points((*point, *target), np.array([[*point.values(), *target.values()]], np.float64))
        with self._lock:
            self._require_open()
            # This checks the keys, too, which `make_trials` does not.
            if (refused := find_refusal(config, point, self._check)) is not None:
                raise PlanError([Problem(refused)], hint="a collection would leave this trial out, as refused")
            (planned,) = make_trials(config, points, first=trial)
            if policy is not None or self._simulator.config is not config:
                self._simulator.use(config, policy)
            episode = self._simulator.run(planned)
        return self._make_throw(config, planned, episode)

    def find_refusal(self, values: Point) -> str | None:
        """Explain why the plan of a collection would refuse a throw with these values; None if it would not.

        Raises:
            ConfigError: If a key cannot vary, or a value is out of its range.
        """
        with self._lock:
            return find_refusal(self.config, complete_point(values, self.config), self._check)

    def throw_many(
        self, points: Iterable[Point], *, targets: Iterable[Point] = (), processes: int = 1
    ) -> Iterator[Throw]:
        """Simulate many throws, which are the trials 0, 1, 2 and so on.

        With several processes, all points are taken before the first throw is there.

        Args:
            points: Values that differ from the configuration, for each throw.
            targets: Where each throw should end; no more for none.
            processes: How many processes simulate, each with a physics engine of its own; 1 for only this process.

        Yields:
            The throws, in the order of their points.

        Raises:
            ConfigError: As `throw`, when it is the turn of that throw.
            PlanError: As `throw`, when it is the turn of that throw; its problem names the index of the point.
            ConflictError: If the simulator is closed.
            WorkerError: If the physics engine of a process does not start, or a process is killed.
        """
        self._require_open()
        aimed = iter(targets)
        numbered = ((trial, point, next(aimed, {})) for trial, point in enumerate(points))
        if processes <= 1:
            yield from map(self._throw_numbered, numbered)
            return
        yield from work_side_by_side(
            tuple(numbered), _begin, (self.config, self._source), processes=processes, doing="simulates"
        )

    def _throw_numbered(self, numbered: tuple[int, Point, Point]) -> Throw:
        """Simulate the throw of a point of a list, given as index, point and target; an error names the index."""
        index, point, target = numbered
        try:
            return self.throw(point, trial=index, target=target)
        except PlanError as error:
            # A wrong value is named by its key, but the motion of a point is wrong as a whole.
            raise PlanError([replace(each, key=f"points[{index}]") for each in error.problems]) from error

    def _require_open(self) -> None:
        """Refuse to simulate after `close`."""
        if not self._simulator.close.alive:
            raise ConflictError("this simulator is closed", hint="make another Simulator")

    def _make_throw(self, config: Config, trial: Trial, episode: Episode) -> Throw:
        keys = tuple(trial.values)
        table = ThrowsTable(keys, config, tuple(trial.target))
        row = table.row(trial, judge_episode(with_values(config, trial.values), episode), None)
        # In a dataset, these two values come from a shard; the row was made without one.
        row |= {"samples": episode.header.samples, "digest": episode.digest}
        return Throw(table.table([row]), 0, keys, episode, self._source, config)


def find_refusal(config: Config, values: Point, check: Check) -> str | None:
    """Explain why the plan of a collection would refuse a trial with these values; None if it would not.

    Raises:
        ConfigError: If a key cannot vary, or a value is out of its range.
    """
    wrong = {key: reason for key in values if (reason := reason_not_sweepable(config, key)) is not None}
    if wrong:
        raise ConfigError([Problem(reason, key=key) for key, reason in wrong.items()])
    return check(with_values(config, values))


def with_policy(
    config: Config, policy: Policy, *, rate_hz: int, command: str, observation: Sequence[str] = ()
) -> Config:
    """Make a copy of a configuration in which a policy commands the joints; its keys are checked as those of a file."""
    config = with_values(config, {"task.policy": PolicyConfig(use=type(policy).__qualname__)})
    config = with_values(config, {"task.policy.rate_hz": rate_hz, "task.policy.observation": list(observation)})
    config = with_values(config, {"task.policy.command": command})
    check_observation(config)
    return config


def _begin(config: Config, source: str) -> Callable[[tuple[int, Point, Point]], Throw]:
    """Make the simulator of a process of `Simulator.throw_many`; the file is not read, because it may have changed."""
    simulator = Simulator(config)
    simulator._source = source
    return simulator._throw_numbered
