"""The coordinator node: finds simulations, leases trials, judges throws, fills the dataset."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass

from throwcollect.config.schema import Config
from throwcollect.config.values import is_physics
from throwcollect.coordinator.goals import FollowJointTrajectory, TrialGoals, trial_goals
from throwcollect.coordinator.growth import Growth
from throwcollect.coordinator.leases import Leases
from throwcollect.coordinator.progress import PROGRESS_QOS, PROGRESS_TOPIC, Progress, String
from throwcollect.coordinator.simulation_client import EPISODE_TOPIC, SimulationClient
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.message import Episode, unpack
from throwcollect.errors import DatasetError
from throwcollect.robots.description import start_posture
from throwcollect.robots.model import joint_limits
from throwcollect.robots.talos import CONTROLLERS, controller_of, graph_name
from throwcollect.robots.trajectory import JointTrajectory
from throwcollect.ros import Node, graph_changes
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.tasks.throw import Outcome, ThrowResult, judge
from throwcollect.tasks.trajectory import throw_trajectory

_DISCOVERY_PERIOD_S = 0.1
_REPORT_PERIOD_S = 0.2
_UNREADABLE_PERIOD_S = 10.0
"""Whoever publishes garbage may do so often."""
_RATE_WINDOW_S = 10.0
"""Throws per second are averaged over this time."""


@dataclass(frozen=True)
class _Setup:
    """Everything that is worked out of a trial before it is leased."""

    config: Config
    trajectory: JointTrajectory
    goals: TrialGoals
    physics: Mapping[str, float]


class Coordinator(Node):
    """Leases the trials of a plan to the simulations in the ROS graph and writes their episodes.

    Args:
        plan: The trials.
        writer: The dataset that is filled.
    """

    def __init__(self, plan: Plan, writer: DatasetWriter) -> None:
        super().__init__("coordinator")
        self._plan = plan
        self._writer = writer
        self._config = plan.config
        self._trials: dict[int, Trial] = {trial.number: trial for trial in plan.trials if trial.refused is None}
        self._leases = Leases(self._trials, retries=self._config.run.retries)
        self._growth = Growth(plan) if self._config.grows else None
        self._limits = joint_limits()
        self._simulations: dict[str, SimulationClient] = {}
        self._discovered_changes = -1
        self._setups: dict[int, _Setup] = {}
        self._backlog: deque[tuple[Episode, _Setup]] = deque()
        self._outcomes: Counter[str] = Counter()
        self._ends: deque[tuple[float, int]] = deque([(time.monotonic(), 0)])
        self._draining = False
        self._drain_deadline = math.inf
        # A simulation that is held back for onlookers needs its time, and is not lost.
        slowed_s = self._config.sim.max_trial_s / (self._config.sim.real_time_factor or math.inf)
        self._patience_s = self._config.run.trial_timeout_s + slowed_s
        joints = self._config.task.end
        naming = self._config.controllers.names
        used = {controller_of(joint) for joint in joints}
        self._controllers = {name: graph_name(name, naming) for name in CONTROLLERS if name in used}
        self._progress = self.create_publisher(String, PROGRESS_TOPIC, PROGRESS_QOS)
        self.create_timer(_DISCOVERY_PERIOD_S, self._discover)
        self.create_timer(_REPORT_PERIOD_S, self.report)

    @property
    def backlog(self) -> int:
        """Number of episodes that have arrived but are not written yet."""
        return len(self._backlog)

    @property
    def finished(self) -> bool:
        """Whether every trial has ended and is written; while draining, whether running ones have ended or had time."""
        if self._backlog:
            return False
        if self.complete:
            return True
        if self._growth is not None and self._growth.over:
            return False
        return self._draining and (self._leases.leased == 0 or time.monotonic() > self._drain_deadline)

    @property
    def complete(self) -> bool:
        """Whether every trial of the plan has ended, and none will be added to it."""
        return self._leases.finished and self._growth is None

    def drain(self) -> None:
        """Lease no more trials; those that run may end within `run.grace_s`."""
        if not self._draining:
            self._draining = True
            self._drain_deadline = time.monotonic() + self._config.run.grace_s

    def recall(self, trial: int, result: ThrowResult) -> None:
        """Count a trial as ended whose episode is in the dataset already, before anything is leased.

        Args:
            trial: Number of the trial.
            result: What came of it.
        """
        self._leases.recall(trial)
        self._note(trial, result)
        self._ends = deque([(time.monotonic(), self._leases.ended)])

    def write_one(self) -> None:
        """Judge and write the oldest episode of the backlog.

        Raises:
            DatasetError: If the dataset cannot be written.
        """
        episode, setup = self._backlog.popleft()
        result = judge(
            episode.samples(), episode.header, config=setup.config, trajectory=setup.trajectory, limits=self._limits
        )
        self._writer.append(episode, result)
        self._note(episode.header.trial, result)

    def prepare_one(self) -> bool:
        """Do a piece of work that can wait, of some milliseconds, so that no simulation will wait for it.

        That is to work out one of the trials that will be leased next, or to get on with the next round of the plan.

        Returns:
            Whether there was something to do.

        Raises:
            DatasetError: If the plan, or a shard that is complete without further trials, cannot be written.
        """
        for trial in self._leases.upcoming(len(self._simulations)):
            if trial not in self._setups:
                self._setups[trial] = self._setup(trial)
                return True
        return self._growth is not None and self._grow(self._growth)

    def _grow(self, growth: Growth) -> bool:
        if growth.over:
            self._growth = None
            self._writer.close_plan()
            return True
        trials = None if self._draining else growth.step()
        if trials:
            self._writer.extend(trials)
            fresh = {trial.number: trial for trial in trials if trial.refused is None}
            self._trials |= fresh
            self._leases.add(fresh)
            for namespace in self._simulations:
                self._lease(namespace)
        return trials is not None

    @property
    def _expected(self) -> int:
        """Number of trials that will be added to the plan, as long as nothing else may end it."""
        return self._growth.most if self._growth is not None and self._config.until is None else 0

    def _note(self, trial: int, result: ThrowResult) -> None:
        self._outcomes[result.outcome.value] += 1
        if self._growth is not None:
            self._growth.tell(trial, result)

    def report(self) -> Progress:
        """Publish the progress, and return it."""
        now = time.monotonic()
        ended = self._leases.ended
        self._ends.append((now, ended))
        while self._ends[0][0] < now - _RATE_WINDOW_S:
            self._ends.popleft()
        since, before = self._ends[0]
        progress = Progress(
            total=self._leases.total + self._expected,
            ended=ended,
            outcomes=dict(self._outcomes),
            simulations=len(self._simulations),
            throws_per_s=(ended - before) / (now - since) if now > since else 0.0,
            hung=[name.strip("/") for name, simulation in self._simulations.items() if simulation.hung],
            wanted=self._config.until.landed if self._config.until else None,
        )
        self._progress.publish(progress.message())
        return progress

    def _discover(self) -> None:
        changes = graph_changes(self)
        if changes != self._discovered_changes:
            self._discovered_changes = changes
            self._find_simulations()
        now = time.monotonic()
        for namespace, simulation in list(self._simulations.items()):
            if now > simulation.deadline:
                simulation.hung = True
                self._take_back(namespace, f"no episode within {self._patience_s:g} s")
            self._lease(namespace)

    def _find_simulations(self) -> None:
        offered = {
            topic.removesuffix(f"/{EPISODE_TOPIC}")
            for topic, types in self.get_topic_names_and_types()
            if topic.endswith(f"/{EPISODE_TOPIC}") and "std_msgs/msg/UInt8MultiArray" in types
            if self.count_publishers(topic)
        }
        for namespace in offered - self._simulations.keys():
            self._simulations[namespace] = SimulationClient(
                self,
                namespace,
                controllers=self._controllers,
                action_type=FollowJointTrajectory,
                on_episode=self._receive,
                on_refusal=self._take_back,
            )
        for namespace in self._simulations.keys() - offered:
            self._take_back(namespace, "left the ROS graph")
            self._simulations.pop(namespace).destroy()

    def _lease(self, namespace: str) -> None:
        simulation = self._simulations.get(namespace)
        if simulation is None or simulation.hung or self._draining or self._leases.held_by(namespace) is not None:
            return
        if not simulation.ready():
            return
        trial = self._leases.lease(namespace)
        if trial is None:
            return
        setup = self._setups.get(trial) or self._setup(trial)
        self._setups[trial] = setup
        simulation.deadline = time.monotonic() + self._patience_s
        self._writer.note("lease", trial=trial, simulation=namespace.strip("/"))
        simulation.begin(trial, setup.physics, setup.goals)

    def _setup(self, number: int) -> _Setup:
        trial = self._trials[number]
        config = self._plan.config_of(trial)
        trajectory = throw_trajectory(config)
        physics = {key: value for key, value in trial.values.items() if is_physics(key)}
        return _Setup(config, trajectory, trial_goals(trajectory, start_posture(config)), physics)

    def _receive(self, namespace: str, message: bytes) -> None:
        try:
            episode = unpack(message)
            # Somebody else may publish here, too: what cannot be read must not end the collection later.
            episode.samples()
        except DatasetError as error:
            self.get_logger().warning(
                f"{namespace}: unreadable episode: {error}", throttle_duration_sec=_UNREADABLE_PERIOD_S
            )
            return
        trial = episode.header.trial
        self._simulations[namespace].hung = False
        if not self._leases.complete(namespace, trial):
            self.get_logger().warning(f"{namespace}: trial {trial} came too late and was dropped")
            return
        self._simulations[namespace].abandon()
        self._lease(namespace)
        self._backlog.append((episode, self._setups.pop(trial)))

    def _take_back(self, namespace: str, reason: str) -> None:
        self._simulations[namespace].abandon()
        trial = self._leases.held_by(namespace)
        if trial is None:
            return
        self.get_logger().warning(f"{namespace}: trial {trial} is given to another simulation: {reason}")
        self._writer.note("fail", trial=trial, simulation=namespace.strip("/"), reason=reason)
        if (given_up := self._leases.fail(namespace, reason)) is not None:
            number, reasons = given_up
            self._setups.pop(number)
            result = ThrowResult(Outcome.LOST, reason="; ".join(reasons))
            self._writer.append_lost(number, "; ".join(reasons))
            self._note(number, result)
