"""The coordinator node: finds simulations, leases trials, judges throws, fills the dataset."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterator

from throwcollect.coordinator.acceptance import Acceptance, Assignment
from throwcollect.coordinator.goals import FollowJointTrajectory
from throwcollect.coordinator.growth import Growth
from throwcollect.coordinator.leases import Leases
from throwcollect.coordinator.progress import Progress
from throwcollect.coordinator.progress_topic import PROGRESS_QOS, PROGRESS_TOPIC, String
from throwcollect.coordinator.simulation_client import EPISODE_TOPIC, SimulationClient
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.episode.message import Episode, unpack
from throwcollect.errors import DatasetError
from throwcollect.robots.model import joint_limits
from throwcollect.robots.talos import CONTROLLERS, controller_of, graph_name
from throwcollect.ros import Node, graph_changes
from throwcollect.run_key import Signer
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.tasks.throw import Outcome, ThrowResult, judge

_DISCOVERY_PERIOD_S = 0.1
_REPORT_PERIOD_S = 0.2
_UNREADABLE_PERIOD_S = 10.0
"""Whoever publishes garbage may do so often."""
_SHARED_PERIOD_S = 10.0
"""Time between two warnings of simulations that share a namespace."""
_UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""What an RMW calls a node that it has not heard of yet, unlike its publisher."""
_REACH_S = 6.0
"""Nodes that see each other are connected within a second, also on a busy machine."""
_RATE_WINDOW_S = 10.0
"""Throws per second are averaged over this time."""


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
        self._visible: set[str] = set()
        self._unreached: dict[str, float] = {}
        self._signer = Signer.of_environment()
        self._acceptance = Acceptance(plan.config)
        self._assignments: dict[int, Assignment] = {}
        self._backlog: deque[tuple[Episode, Assignment]] = deque()
        self._set_aside: dict[str, str] = {}
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

    @property
    def hopeless(self) -> str | None:
        """Why no simulation will ever do a trial; None if there is hope."""
        return self._leases.hopeless(self._simulations)

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
        """Check, judge and write the oldest episode of the backlog.

        Raises:
            DatasetError: If the dataset cannot be written.
        """
        episode, assignment = self._backlog.popleft()
        trial = episode.header.trial
        if (problem := self._acceptance.unsound(episode, assignment)) is not None:
            simulation = self._leases.deliverer(trial)
            self._assignments[trial] = assignment
            self._give_back(
                simulation, trial, f"its episode is refused: {problem}", self._leases.reject(trial, problem)
            )
            return
        result = judge(
            episode.samples(),
            episode.header,
            config=assignment.config,
            trajectory=assignment.trajectory,
            limits=self._limits,
        )
        self._writer.append(episode, result)
        self._leases.complete(trial)
        self._tell_set_aside()
        self._note(trial, result)

    def prepare_one(self) -> bool:
        """Do a piece of work that can wait, of some milliseconds, so that no simulation will wait for it.

        That is to work out one of the trials that will be leased next, or to get on with the next round of the plan.

        Returns:
            Whether there was something to do.

        Raises:
            DatasetError: If the plan, or a shard that is complete without further trials, cannot be written.
        """
        for trial in self._leases.upcoming(len(self._simulations)):
            if trial not in self._assignments:
                self._assignments[trial] = self._assign(trial)
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
            hung=sorted(
                {simulation.name for simulation in self._simulations.values() if simulation.hung} | self._unreachable
            ),
            wanted=self._config.until.landed if self._config.until else None,
            set_aside={self._name_in(namespace): reason for namespace, reason in self._set_aside.items()},
        )
        self._progress.publish(String(data=progress.to_json()))
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
                besides = f", and no answer to {simulation.unanswered[0]}" if simulation.unanswered else ""
                self._take_back(namespace, f"no episode within {self._patience_s:g} s{besides}")
            elif (missing := simulation.remind()) is not None:
                trial = self._leases.held_by(namespace)
                self.get_logger().warning(f"{namespace}: no answer to {missing} of trial {trial}, which is sent again")
            self._lease(namespace)
        self._notice_unreached(now)

    def _notice_unreached(self, now: float) -> None:
        """Notice simulations that are in the graph and cannot be asked: the connection to them was never made whole."""
        reached = {namespace for namespace, simulation in self._simulations.items() if simulation.ready()}
        self._unreached = {
            namespace: self._unreached.get(namespace, now) for namespace in self._visible if namespace not in reached
        }

    @property
    def _unreachable(self) -> set[str]:
        """Names of simulations that have been out of reach for too long; a new connection is a matter of luck."""
        latest = time.monotonic() - _REACH_S
        return {self._name_in(namespace) for namespace, since in self._unreached.items() if since < latest}

    def _find_simulations(self) -> None:
        self._visible.clear()
        offered = {namespace: (name, publishers) for namespace, name, publishers in self._offered()}
        for namespace, simulation in list(self._simulations.items()):
            name, publishers = offered.get(namespace, ("", frozenset()))
            if name != simulation.name:
                self._lose(namespace, "left the ROS graph")
            elif publishers - simulation.publishers:
                # Where nodes are silent for a while before they count as gone, its successor is there first.
                self._lose(namespace, "was started again")
        for namespace in offered.keys() - self._simulations.keys():
            self._simulations[namespace] = SimulationClient(
                self,
                namespace,
                *offered[namespace],
                controllers=self._controllers,
                action_type=FollowJointTrajectory,
                on_episode=self._receive,
                on_refusal=lambda name, reason: self._take_back(name, reason, refused=True),
            )

    def _lose(self, namespace: str, reason: str) -> None:
        self._take_back(namespace, reason)
        self._leases.forget(namespace)
        self._simulations.pop(namespace).destroy()

    def _offered(self) -> Iterator[tuple[str, str, frozenset[bytes]]]:
        """Each simulation in the graph, which is a node that publishes episodes: namespace, name, its publishers."""
        for topic, types in self.get_topic_names_and_types():
            above, _, last = topic.rpartition("/")
            if last != EPISODE_TOPIC or "std_msgs/msg/UInt8MultiArray" not in types:
                continue
            publishers: defaultdict[str, set[bytes]] = defaultdict(set)
            for info in self.get_publishers_info_by_topic(topic):
                publishers[info.node_name].add(bytes(info.endpoint_gid))
            if publishers:
                self._visible.add(above or "/")
            names = publishers.keys() - {_UNKNOWN}
            # Whoever else publishes there, the simulation sim_0 is the node sim_0 in the namespace /sim_0.
            names = names & {above.removeprefix("/")} or names
            if len(names) > 1:
                self.get_logger().warning(
                    f"namespace {above or '/'}: gets no trials, as it is that of {len(names)} simulations: "
                    f"{', '.join(sorted(names))}",
                    throttle_duration_sec=_SHARED_PERIOD_S,
                )
            elif names:
                (name,) = names
                yield above or "/", name, frozenset(publishers[name])

    def _name_in(self, namespace: str) -> str:
        """Name of the simulation in a namespace, also when it has left."""
        simulation = self._simulations.get(namespace)
        return namespace.strip("/") if simulation is None else simulation.name

    def _lease(self, namespace: str) -> None:
        simulation = self._simulations.get(namespace)
        if simulation is None or simulation.hung or self._draining or self._leases.held_by(namespace) is not None:
            return
        if not simulation.ready():
            return
        trial = self._leases.lease(namespace, others=self._simulations)
        if trial is None:
            return
        assignment = self._assignments.get(trial) or self._assign(trial)
        self._assignments[trial] = assignment
        simulation.deadline = time.monotonic() + self._patience_s
        self._writer.note("lease", trial=trial, simulation=simulation.name)
        lease = assignment.lease(namespace, trial)
        simulation.begin(lease, lease.sign(self._signer), assignment.messages)

    def _assign(self, number: int) -> Assignment:
        return self._acceptance.assign(self._plan, self._trials[number])

    def _receive(self, namespace: str, message: bytes) -> None:
        try:
            delivery = unpack(message, self._signer)
            # What cannot be read must not end the collection later.
            delivery.episode.samples()
        except DatasetError as error:
            # Anybody may have sent it, so it says nothing about the simulation.
            self.get_logger().warning(
                f"{namespace}: an episode is dropped: {error}", throttle_duration_sec=_UNREADABLE_PERIOD_S
            )
            return
        trial = delivery.episode.header.trial
        simulation = self._simulations[namespace]
        simulation.hung = False
        if self._leases.held_by(namespace) != trial:
            self.get_logger().warning(f"{namespace}: trial {trial} came too late and was dropped")
            return
        assignment = self._assignments[trial]
        if (reason := self._acceptance.foreign(delivery, assignment, simulation.token)) is not None:
            self._take_back(namespace, f"its episode is refused: {reason}", refused=True)
            return
        self._leases.deliver(namespace, trial)
        simulation.abandon()
        self._lease(namespace)
        self._backlog.append((delivery.episode, self._assignments.pop(trial)))

    def _take_back(self, namespace: str, reason: str, *, refused: bool = False) -> None:
        self._simulations[namespace].abandon()
        trial = self._leases.held_by(namespace)
        if trial is not None:
            given_up = self._leases.fail(namespace, reason, refused=refused)
            self._give_back(namespace, trial, reason, given_up and given_up[1])

    def _tell_set_aside(self) -> None:
        aside = {name: reason for name in self._simulations if (reason := self._leases.set_aside(name)) is not None}
        for name in aside.keys() - self._set_aside.keys():
            reason = f"others could do what it refused: {aside[name]}"
            self.get_logger().warning(f"{name}: gets no more trials, as {reason}")
        self._set_aside = aside

    def _give_back(self, namespace: str, trial: int, reason: str, given_up: list[str] | None) -> None:
        """Tell of a trial that goes to another simulation, or write that it is lost, with the reasons."""
        self.get_logger().warning(f"{namespace}: trial {trial} is given to another simulation: {reason}")
        self._writer.note("fail", trial=trial, simulation=self._name_in(namespace), reason=reason)
        if given_up is not None:
            del self._assignments[trial]
            self._writer.append_lost(trial, "; ".join(given_up))
            self._note(trial, ThrowResult(Outcome.LOST, reason="; ".join(given_up)))
