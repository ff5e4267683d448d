"""The coordinator's process and node, which sends trials to the simulations in the ROS graph, and takes episodes in."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from collections.abc import Set as AbstractSet
from pathlib import Path

from throwcollect import ros
from throwcollect.collect.coordinator.collection import TrialCollection
from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator_node.preview import PROGRESS_QOS, PROGRESS_TOPIC, EpisodePreview
from throwcollect.collect.coordinator_node.simulation_client import EPISODE_TOPIC, SimulationClient
from throwcollect.episode.episode_message import TrialRefusal, unpack
from throwcollect.errors import DatasetError, WorkerError
from throwcollect.own_process import Heartbeat
from throwcollect.plan.lease import Lease
from throwcollect.ros import Node, graph_changes
from throwcollect.ros.msg import String
from throwcollect.ros.serving import begin_to_serve
from throwcollect.run_key import Signer
from throwcollect.side_by_side import count_cores

_IDLE_S = 0.05
_REPORT_EVERY_S = 10.0
"""Real time between two lines of progress in the log; it is published on its topic more often."""

_DISCOVERY_PERIOD_S = 0.05
_REST = 10
"""Looking for simulations rests for so many times its processor time, which grows with their number."""
_REPORT_PERIOD_S = 0.2
_WARNING_PERIOD_S = 10.0
"""Time between two warnings of the same thing."""
_UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""An RMW gives this name to a node when it has heard of its publisher, and not yet of the node."""
_REACH_S = 6.0
"""Time after which a simulation that cannot be asked counts as out of reach: nodes usually connect within a second."""


class Coordinator(Node):
    """Leases the trials of a collection to the simulations in the ROS graph."""

    def __init__(self, collection: TrialCollection) -> None:
        super().__init__("coordinator")
        self._collection = collection
        collection.warn = self.get_logger().warning
        collection.on_change = self._lease_to_all
        config = collection.writer.plan.config
        self._simulations: dict[str, SimulationClient] = {}
        self._discovered_changes = -1
        self._rests_until = 0.0
        self._visible: set[str] = set()
        self._unreached: dict[str, float] = {}
        self._left: dict[str, tuple[AbstractSet[bytes], float]] = {}
        """Publishers of simulations that are out of sight, by namespace, and since when [s]."""
        self._signer = Signer.of_environment()
        # A real-time factor slows trials down on purpose, even one that a viewer has set without the coordinator.
        # The slowest one is allowed for before a simulation counts as lost.
        self._patience_s = config.run.trial_timeout_s + config.sim.max_trial_s / config.sim.slowest_factor
        self._preview = EpisodePreview(self)
        self._progress = self.create_publisher(String, PROGRESS_TOPIC, PROGRESS_QOS)
        self.create_timer(_DISCOVERY_PERIOD_S, self._discover)
        self.create_timer(_REPORT_PERIOD_S, self.report)

    @property
    def sees_simulations(self) -> bool:
        """Whether a simulation is in the ROS graph."""
        return bool(self._simulations)

    def report(self) -> Progress:
        """Publish the progress, and return it."""
        hung = {simulation.name for simulation in self._simulations.values() if simulation.hung}
        progress = self._collection.progress(hung | self._unreachable)
        self._progress.publish(String(data=progress.to_json()))
        return progress

    def _discover(self) -> None:
        changes, now = graph_changes(self), time.monotonic()
        if changes != self._discovered_changes and now >= self._rests_until:
            self._discovered_changes = changes
            self._find_simulations()
            now = time.monotonic()
        for namespace, simulation in list(self._simulations.items()):
            if now > simulation.began_s + self._patience_s:
                self._stop_waiting(namespace, simulation)
            elif (missing := simulation.remind()) is not None:
                self.get_logger().warning(f"{namespace}: no answer to the lease of {missing}, which is sent again")
            # Each time, trials of others may have come back, or the simulation may have become reachable.
            self._lease(namespace)
        for namespace in [name for name, (_, since) in self._left.items() if now > since + self._patience_s]:
            self._settle(namespace, alive=False)
        self._notice_unreached(now)

    def _notice_unreached(self, now: float) -> None:
        """Note since when simulations have been in the graph without being ready: they are connected only in part."""
        reached = {namespace for namespace, simulation in self._simulations.items() if simulation.ready()}
        self._unreached = {
            namespace: self._unreached.get(namespace, now) for namespace in self._visible if namespace not in reached
        }

    @property
    def _unreachable(self) -> set[str]:
        """Names of simulations that have been out of reach for too long; the launcher starts them again."""
        latest = time.monotonic() - _REACH_S
        return {self._collection.name_of(namespace) for namespace, since in self._unreached.items() if since < latest}

    def _find_simulations(self) -> None:
        self._visible.clear()
        began_s = time.thread_time()
        offered = {namespace: (name, publishers) for namespace, name, publishers in self._find_offers()}
        self._rests_until = time.monotonic() + _REST * (time.thread_time() - began_s)
        for namespace, simulation in list(self._simulations.items()):
            name, publishers = offered.get(namespace, ("", frozenset()))
            if name != simulation.name:
                self._lose(namespace, "left the ROS graph")
            elif publishers - simulation.publishers:
                # The graph may keep a dead node for a while, and show its successor at the same time.
                self._lose(namespace, "was started again")
        for namespace in offered.keys() - self._simulations.keys():
            self._simulations[namespace] = SimulationClient(
                self,
                namespace,
                *offered[namespace],
                make_lease=self._make_lease,
                on_episode=self._receive,
                on_refusal=self._take_refusal,
            )
            if namespace in self._left:
                self._settle(namespace, alive=offered[namespace][1] <= self._left[namespace][0])
            self._collection.join(namespace, offered[namespace][0])

    def _lose(self, namespace: str, reason: str) -> None:
        self._collection.leave(namespace, reason)
        simulation = self._simulations.pop(namespace)
        simulation.destroy()
        self._left[namespace] = simulation.publishers, time.monotonic()

    def _settle(self, namespace: str, *, alive: bool) -> None:
        """Note what became of a simulation out of sight: only its connection was lost if its publishers are there."""
        del self._left[namespace]
        self._collection.settle(namespace, alive=alive)

    def _find_offers(self) -> Iterator[tuple[str, str, frozenset[bytes]]]:
        """Find the simulations in the graph, nodes that publish episodes: namespace, name and publishers of each."""
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
            # If other nodes publish there too, the simulation is the node with the name of the namespace.
            names = names & {above.removeprefix("/")} or names
            if len(names) > 1:
                self.get_logger().warning(
                    f"namespace {above or '/'}: gets no trials, as {len(names)} simulations share it: "
                    f"{', '.join(sorted(names))}",
                    throttle_duration_sec=_WARNING_PERIOD_S,
                )
            elif names:
                (name,) = names
                yield above or "/", name, frozenset(publishers[name])

    def _lease_to_all(self) -> None:
        for namespace in self._simulations:
            self._lease(namespace)

    def _lease(self, namespace: str) -> None:
        simulation = self._simulations.get(namespace)
        if simulation is None or simulation.hung or not simulation.ready():
            return
        simulation.ask(self._collection.lease(namespace))

    def _make_lease(self, namespace: str, trial: int) -> Lease:
        planned = self._collection.writer.plan.trial(trial)
        return Lease.make(namespace, trial, planned.values, self._signer, seed=planned.seed, target=planned.target)

    def _receive(self, namespace: str, message: bytes) -> None:
        try:
            handed = unpack(message, self._signer)
        except DatasetError as error:
            # Any node may have sent it, so the simulation is not blamed.
            self.get_logger().warning(
                f"{namespace}: an episode is dropped: {error}", throttle_duration_sec=_WARNING_PERIOD_S
            )
            return
        simulation = self._simulations[namespace]
        simulation.finish(handed.trial if isinstance(handed, TrialRefusal) else handed.header.trial)
        if isinstance(handed, TrialRefusal):
            self._collection.refuse(namespace, handed.trial, handed.reason)
        elif self._collection.take_in(namespace, handed):
            self._preview.offer(simulation.name, message)
        self._lease(namespace)

    def _stop_waiting(self, namespace: str, simulation: SimulationClient) -> None:
        """Take the trials of a simulation that is too slow; if it is alive, give all simulations more time."""
        alive = simulation.alive
        reason = f"no episode within {self._patience_s:g} s{'' if alive else ', and no answer to the lease'}"
        simulation.hung = True
        simulation.abandon()
        self._collection.take_back(namespace, reason, alive=alive)
        if alive:
            self._patience_s *= 2

    def _take_refusal(self, namespace: str, reason: str) -> None:
        self._simulations[namespace].abandon()
        self._collection.take_back(namespace, reason, refused=True)


def run(directory: Path, *, patience_s: float = math.inf) -> None:
    """Collect all trials of a dataset's plan that have no episode yet, and finish the dataset.

    SIGINT, SIGTERM and SIGHUP drain: running trials are finished and written within `run.grace_s`, none is started.

    Args:
        directory: Its directory.
        patience_s: How long to go on while no simulation is there [s]. A launcher looks after its simulations itself.
    """
    # The dataset is opened before the node exists, because opening a large one takes long and a node has to answer.
    with TrialCollection.open(directory, say=_say, processes=count_cores()) as collection:
        ros.init()
        # Note in the journal that any node could join this run, because the finished dataset records it.
        if not ros.joins_protected():
            collection.writer.note("exposed")
        node = Coordinator(collection)
        executor, stopped = begin_to_serve(node)
        heartbeat = Heartbeat()

        def keep_answering() -> None:
            """Answer other nodes while trials are simulated again."""
            heartbeat.beat()
            executor.spin_once(timeout_sec=_IDLE_S)

        try:
            _collect(node, collection, executor, heartbeat, stopped, patience_s=patience_s)
            collection.finish(meanwhile=keep_answering, say=_say)
        finally:
            node.destroy_node()
            ros.shutdown()


def _collect(
    node: Coordinator,
    collection: TrialCollection,
    executor: ros.Executor,
    heartbeat: Heartbeat,
    stopped: Callable[[], int],
    *,
    patience_s: float,
) -> None:
    """Collect until all trials have ended or, after a signal that asks to stop, those that run."""
    reported = seen = time.monotonic()
    while not collection.finished:
        heartbeat.beat()
        if stopped():
            collection.drain()
        ros.spin_some(executor, timeout_sec=0.0 if collection.check_next() else _IDLE_S)
        collection.look_after()
        if node.sees_simulations:
            seen = time.monotonic()
        elif time.monotonic() > seen + patience_s:
            raise WorkerError(
                f"no simulation was there for {patience_s:g} s (run.start_timeout_s)",
                hint="the simulations print the reason",
            )
        if time.monotonic() >= reported + _REPORT_EVERY_S:
            reported = time.monotonic()
            _say(node.report().line)
    _say(node.report().line)


def _say(line: str) -> None:
    print(line, flush=True)
