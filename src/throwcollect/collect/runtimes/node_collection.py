"""Drives a run with nodes from its start to its end: keeps the nodes alive, listens to them, scales and stops them.

The launcher is the node ``/launcher`` meanwhile; setting its integer parameter ``simulations`` scales the run.
"""

from __future__ import annotations

import math
import time

from throwcollect import ros
from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.runtimes.nodes import (
    CONFIGURATION,
    CONTAINER,
    COORDINATOR,
    LAUNCHER,
    ROBOT_FILES,
    ROUTER,
    SIMULATIONS,
    NodeExit,
    NodeHost,
    NodeRole,
    NodeSpec,
    is_simulation,
    list_simulations,
    name_simulation,
)
from throwcollect.collect.runtimes.run_listener import RunListener
from throwcollect.collect.runtimes.runtime import Session
from throwcollect.collect.runtimes.supervisor import Supervisor
from throwcollect.dataset.carried_robot import config_text, pack_robot
from throwcollect.dataset.summary import Info
from throwcollect.errors import DatasetError, LossError, WorkerError
from throwcollect.ros import IntegerRange
from throwcollect.ros.fast_dds import SERVER_REST_S

MOST_SIMULATIONS = 256

_POLL_S = 0.05
_MEET_S = 12.0
_MEET_EACH_S = 0.5
"""Simulations that are ready are usually seen within a second, but many that start at once share cores and a router.
Something is wrong after the first of these times plus the second one for each simulation."""


def roster(host: NodeHost, simulations: int) -> list[NodeSpec]:
    """List the nodes of a run: a router, simulations, and a coordinator if the run collects a dataset."""
    if host.record.kind == "container":
        return [NodeSpec(CONTAINER, (), NodeRole.MAIN)]
    rest_s = SERVER_REST_S if host.record.middleware.is_fast_dds else 0.0
    return [
        NodeSpec(ROUTER, ("router", "--listen", host.listen), NodeRole.VITAL, rest_s=rest_s),
        *list_simulations([*map(name_simulation, range(simulations))], host.data, recordings=host.record.recordings),
        *([NodeSpec(COORDINATOR, ("coordinator", host.data), NodeRole.MAIN)] if host.record.collects else []),
    ]


def offer_scaling(node: ros.Node, simulations: int, *, most: int) -> None:
    """Declare the launcher's parameter by which any ROS 2 node may change the number of simulations, up to `most`."""
    span = IntegerRange(from_value=0, to_value=most, step=1)
    descriptor = ros.ParameterDescriptor(description="Number of simulations.", integer_range=[span])
    node.declare_parameter(SIMULATIONS, simulations, descriptor)


class NodeCollection:
    """Drives one run with nodes; closes the host at the end."""

    def __init__(self, host: NodeHost, session: Session) -> None:
        self._host = host
        self._session = session
        self._simulations = host.record.simulations
        self._node: ros.Node | None = None
        self._apart_since = math.inf
        self._started_again = False
        self._supervisor = Supervisor(host, host.config.run, roster(host, self._simulations))
        self._listener = RunListener(self._report, name=LAUNCHER, reports=host.record.collects, on_connect=self._offer)

    def run_to_the_end(self) -> Info | None:
        """Collect until every trial has ended; a run without a dataset goes on until it is stopped."""
        with self._supervisor, self._listener:
            self._host.open()
            self._session.event("started", simulations=self._simulations)
            self._supervisor.start()
            end = self._follow()
            self._check(end)
            if not self._host.record.collects:
                return None
            # The simulations end while this process reads the dataset.
            self._supervisor.dismiss()
            from throwcollect.dataset.inspect import info

            return info(self._host.record.directory)

    def _follow(self) -> NodeExit | None:
        """Look after the nodes until the run ends or is interrupted.

        Returns:
            How the main node ended; None if it had to be ended by force, or there is none.
        """
        end = None
        while end is None and not self._session.interruptions():
            self._listen()
            wanted = self._simulations if self._node is None else int(self._node.get_parameter(SIMULATIONS).value)
            if wanted != self._simulations:
                self._simulations = wanted
                self._session.event("scaled", simulations=self._simulations)
                self._supervisor.change(roster(self._host, self._simulations))
            end, news = self._supervisor.poll()
            for line in news:
                self._session.reporter.warn(line)
            self._session.nodes(self._supervisor.states(), endpoint=self._host.endpoint, simulations=self._simulations)
        if end is None:
            self._session.event("stopping")
            if not self._host.record.collects:
                return None
            self._session.reporter.say("interrupted: finishing the running trials; once more ends at once")
            end = self._supervisor.drain(hurry=lambda: self._session.interruptions() > 1)
        # While this process waited for the end of the coordinator, its last report may have arrived.
        self._listen()
        return end

    def _check(self, end: NodeExit | None) -> None:
        record = self._host.record
        # The dataset is finished even if trials are lost; the launcher reports the loss from the summary.
        finished = end is not None and (end.code == 0 or (record.collects and end.code == LossError.exit_code))
        if record.collects and self._session.interruptions() and not finished:
            raise record.interruption
        if end is not None and not finished:
            kind = DatasetError if end.code == DatasetError.exit_code else WorkerError
            hint = record.resume_command if kind is WorkerError else None
            raise kind(f"the {end.name} stopped: {end.reason}", evidence=end.log or None, hint=hint)

    def _listen(self) -> None:
        self._listener.spin(self._host.connection, _POLL_S)

    def _report(self, progress: Progress) -> None:
        self._session.update(progress)
        self._check_that_nodes_meet(progress)
        self._supervisor.replace(progress.hung)

    def _check_that_nodes_meet(self, progress: Progress) -> None:
        """Start all nodes again if they do not see each other, which at times happens on DDS."""
        states = self._supervisor.states()
        ready = any(state.status == "running" for state in states if is_simulation(state.name))
        if progress.simulations or progress.ended or not ready:
            self._apart_since = math.inf
            return
        self._apart_since = min(self._apart_since, time.monotonic())
        patience_s = _MEET_S + _MEET_EACH_S * self._simulations
        if time.monotonic() - self._apart_since <= patience_s:
            return
        if not self._started_again:
            self._started_again = True
            # The new nodes get the same time to meet, from the first report of the new coordinator on.
            self._apart_since = math.inf
            self._session.reporter.warn("the coordinator does not see the simulations; all of them are started again")
            self._supervisor.replace([state.name for state in states if state.name != ROUTER])
        else:
            raise WorkerError(
                f"simulations have been ready for {patience_s:g} s, twice, but the coordinator does not see them",
                evidence=f"they use {self._host.record.middleware.rmw}, and the router at {self._host.endpoint}",
                hint="throwcollect logs router shows what it printed; a firewall may keep nodes apart",
            )

    def _offer(self, node: ros.Node) -> None:
        """Declare the launcher's parameters: the number of simulations, and the configuration for other machines."""
        config = self._host.config
        for name, text in ((CONFIGURATION, config_text(config)), (ROBOT_FILES, pack_robot(config))):
            node.declare_parameter(name, text, ros.ParameterDescriptor(read_only=True))
        most = 1 if config.run.root_namespace else MOST_SIMULATIONS
        offer_scaling(node, self._simulations, most=most)
        # `_follow` reads it, so that the client that sets the parameter does not wait for nodes to end.
        self._node = node
