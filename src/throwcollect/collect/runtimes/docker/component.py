"""The host of a run that is one container: an instance of a component, which may join another run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from docker.types import EndpointConfig

from throwcollect.collect.runtimes.docker.checks import check_container
from throwcollect.collect.runtimes.docker.container_options import (
    API_VERSION,
    JOINED_LABEL,
    KEY,
    ROUTER_PORT,
    container_options,
    key_mount,
    network_of,
)
from throwcollect.collect.runtimes.docker.containers import ANSWER_S, Containers
from throwcollect.collect.runtimes.docker.docker_engine import connect
from throwcollect.collect.runtimes.docker.docker_nodes import describe_container_end
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import ROUTER
from throwcollect.collect.runtimes.run_record import NodeState, RunRecord
from throwcollect.collect.runtimes.runtime import Session
from throwcollect.config.run import ContainerSpec
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import RMW_VARIABLE
from throwcollect.wording import command

CONTAINER = "container"
"""Name of the only node of such a run."""
_POLL_S = 0.1
_OVER_S = 3.0
"""When a run ends, a container that joined it loses the router up to this time before the record shows the end."""


@dataclass(frozen=True)
class JoinOptions:
    """Everything that a container needs to join the ROS graph of a run; `run` is the id of that run.

    Attributes:
        environment: Environment variables with which the container joins.
        key: The run's key, as a mount.
        network: The engine's network in which the router is; None if the container needs the network of this machine.
    """

    run: str
    environment: Mapping[str, str]
    key: str
    network: str | None


def find_join_options(run: str, runtime: str, connection: Connection, spec: ContainerSpec) -> JoinOptions:
    """Find out how a container can join a run of a runtime; processes of this machine join that run by `connection`."""
    if connection.middleware.is_fast_dds:
        raise ConfigError(
            f"run {run}: is on Fast DDS, which containers of the catalogue cannot join",
            hint="run.ros: embedded, or RMW_IMPLEMENTATION=rmw_zenoh_cpp for rclpy",
        )
    endpoint, network = connection.endpoint, None
    if runtime == "docker":
        endpoint, network = f"{endpoint.partition('/')[0]}/{ROUTER}:{ROUTER_PORT}", network_of(run)
    elif spec.section.ports or spec.section.networks:
        raise ConfigError(
            f"run {run}: its nodes are processes, so a container that joins it has this machine's network and no other",
            expected="a component without ports and networks",
            hint="leave them out in the catalogue, or have the run in containers: run.runtime: docker",
        )
    inside = Connection(endpoint, KEY, connection.domain_id, connection.middleware)
    environment = {**inside.environment(), RMW_VARIABLE: connection.middleware.rmw}
    return JoinOptions(run, environment, key_mount(connection.key), network)


class ComponentContainer:
    """Runs one container until it ends or the user asks to stop; a `runtime.Host`.

    Args:
        record: The run that consists of this container.
        joining: The options for the run that the container joins; None if it joins none.
        is_running: Returns whether the run with an id is running; it is called again and again.
        warn: Gets a line when the engine is silent for long.
    """

    def __init__(
        self,
        record: RunRecord,
        component: str,
        spec: ContainerSpec,
        joining: JoinOptions | None,
        *,
        is_running: Callable[[str], bool],
        warn: Callable[[str], None],
    ) -> None:
        self.cleared = False
        self._spec = spec
        self._joining = joining
        self._is_running = is_running
        self._record = record
        self._logs = NodeLogs(record.logs)
        client = connect(timeout_s=ANSWER_S)
        check_container(client, self._spec, component)
        self._containers = Containers(client, record.run, self._logs, warn)

    def collect(self, session: Session) -> None:
        """Run the container until it ends, the user asks to stop, or the run that it has joined ends; then close."""
        try:
            self._containers.open()
            session.event("started")
            # Up to version 1.43 of the engine's API, a container is made in one network, and joins others afterwards.
            self._containers.start(CONTAINER, self._make_options(), networks=self._networks[1:])
            while not session.interruptions():
                session.nodes([self._get_state()], endpoint=None, simulations=0)
                if self._has_ended(session):
                    return
                time.sleep(_POLL_S)
            session.event("stopping")
        finally:
            self.close()

    def close(self) -> None:
        """End the container, and remove it, unless the engine is silent or refuses."""
        self.cleared = self._containers.close()

    @property
    def _networks(self) -> list[str]:
        """Networks that the container joins; none means that of this machine, or the engine's default."""
        own = [self._joining.network] if self._joining is not None and self._joining.network is not None else []
        # The engine publishes ports only from a network with a way out, which the network of a run may not have.
        out = ["bridge"] if own and self._spec.section.ports and not self._spec.section.networks else []
        return [*out, *self._spec.section.networks, *own]

    @property
    def _is_left_behind(self) -> bool:
        """Whether the run that the container has joined has ended."""
        return self._joining is not None and not self._is_running(self._joining.run)

    def _make_options(self) -> dict[str, Any]:
        joining, spec = self._joining, self._spec
        options = container_options(
            self._record,
            spec.image,
            CONTAINER,
            spec.section,
            environment={} if joining is None else joining.environment,
            mounts=[] if joining is None else [joining.key],
        )
        if spec.command is not None:
            options["command"] = list(spec.command)
        if joining is not None:
            options["labels"] |= {JOINED_LABEL: joining.run}
        if joining is not None and joining.network is None:
            options["network_mode"] = "host"
            del options["ports"]
        elif self._networks:
            first = self._networks[0]
            options["network"] = first
            options["networking_config"] = {first: EndpointConfig(API_VERSION)}
        return options

    def _get_state(self) -> NodeState:
        container = self._containers.by_node[CONTAINER]
        if container.id is None:
            return NodeState(CONTAINER, "starting", 0, None, None)
        return NodeState(CONTAINER, "frozen" if container.paused else "running", 0, container.id[:12], None)

    def _has_ended(self, session: Session) -> bool:
        """Whether the container has ended well, or the run that it has joined has ended."""
        containers = self._containers
        containers.warn_if_silent()
        if containers.given_up:
            raise WorkerError(
                f"the Docker engine has not answered for {containers.silent_s:.0f} s",
                hint=f"once it answers, {command('down', '--run', self._record.run)} ends the container",
            )
        if (failure := containers.by_node[CONTAINER].failure) is not None:
            raise WorkerError(f"the container of {self._spec.image} cannot be started: {failure}")
        state = containers.by_node[CONTAINER].state
        if state is not None and state.ended:
            # The end of the joined run may have made the container fail; the record of that run shows it a bit later.
            deadline = time.monotonic() + _OVER_S
            while state.code != 0 and self._joining and not self._is_left_behind and time.monotonic() < deadline:
                time.sleep(_POLL_S)
            if state.code == 0 or self._is_left_behind:
                return True
            reason = describe_container_end(state, self._spec.section.memory)
            raise WorkerError(
                f"the container of {self._spec.image} has ended: {reason}", evidence=self._logs.tail(CONTAINER) or None
            )
        if self._joining is not None and self._is_left_behind:
            session.say(f"run {self._joining.run} has ended, so the container that had joined it ends, too")
            return True
        return False
