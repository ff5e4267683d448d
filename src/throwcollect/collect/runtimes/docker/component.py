"""The host of a run that is one container: an instance of a component, which may join another run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from docker.types import EndpointConfig

from throwcollect.collect.runtimes.docker.checks import check_container
from throwcollect.collect.runtimes.docker.container_options import (
    API_VERSION,
    JOINED_LABEL,
    KEY,
    ROUTER_PORT,
    make_container_options,
    make_key_mount,
    name_network,
)
from throwcollect.collect.runtimes.docker.containers import ANSWER_S, ContainerHost
from throwcollect.collect.runtimes.docker.docker_engine import connect
from throwcollect.collect.runtimes.nodes import CONTAINER, ROUTER, NodeExit, NodeSpec
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.run import ContainerSpec, NodeContainerConfig, RunConfig
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import RMW_VARIABLE

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
        endpoint, network = f"{endpoint.partition('/')[0]}/{ROUTER}:{ROUTER_PORT}", name_network(run)
    elif spec.section.ports or spec.section.networks:
        raise ConfigError(
            f"run {run}: its nodes are processes, so a container that joins it has this machine's network and no other",
            expected="a component without ports and networks",
            hint="leave them out in the catalogue, or have the run in containers: run.runtime: docker",
        )
    inside = Connection(endpoint, KEY, connection.domain_id, connection.middleware)
    environment = {**inside.environment(), RMW_VARIABLE: connection.middleware.rmw}
    return JoinOptions(run, environment, make_key_mount(connection.key), network)


class ComponentContainer(ContainerHost):
    """Runs one container, once, until it ends or the run that it has joined ends.

    Args:
        record: The run that consists of this container.
        joining: The options for the run that the container joins; None if it joins none.
        is_running: Returns whether the run with an id is running; it is called again and again.
        warn: Gets a line when the engine is silent for long.
    """

    listen, data, endpoint = "", "", None

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
        super().__init__(record, Config(run=RunConfig(restarts=0)), connect(timeout_s=ANSWER_S), warn)
        check_container(self._client, spec, component)
        self._spec = spec
        self._joining = joining
        self._is_running = is_running

    def find_section(self, name: str) -> NodeContainerConfig:
        """See `ContainerHost.find_section`."""
        return self._spec.section

    def frozen(self) -> frozenset[str]:
        """None: nothing waits for the container, so it may be paused."""
        return frozenset()

    def exits(self) -> list[NodeExit]:
        """The container, once it or the run that it has joined has ended."""
        ends = super().exits()
        # The end of the joined run may have made the container fail; the record of that run shows it a bit later.
        deadline = time.monotonic() + _OVER_S
        while ends and ends[0].code != 0 and self._joining and not self._is_left() and time.monotonic() < deadline:
            time.sleep(_POLL_S)
        return [NodeExit(CONTAINER, 0, "the run that it has joined has ended", "")] if self._is_left() else ends

    def _is_left(self) -> bool:
        """Whether the run that the container has joined has ended."""
        return self._joining is not None and not self._is_running(self._joining.run)

    def make_options(self, node: NodeSpec) -> tuple[dict[str, Any], Sequence[str]]:
        """See `ContainerHost.make_options`."""
        joining, spec = self._joining, self._spec
        options = make_container_options(
            self.record,
            spec.image,
            node.name,
            spec.section,
            environment={} if joining is None else joining.environment,
            mounts=[] if joining is None else [joining.key],
        )
        if spec.command is not None:
            options["command"] = list(spec.command)
        if joining is not None:
            options["labels"] |= {JOINED_LABEL: joining.run}
        own = [joining.network] if joining is not None and joining.network is not None else []
        # The engine publishes ports only from a network with a way out, which the network of a run may not have.
        out = ["bridge"] if own and spec.section.ports and not spec.section.networks else []
        networks = [*out, *spec.section.networks, *own]
        if joining is not None and joining.network is None:
            options["network_mode"] = "host"
            del options["ports"]
        elif networks:
            # Up to version 1.43 of the engine's API, a container is made in one network, and joins others afterwards.
            options["network"] = networks[0]
            options["networking_config"] = {networks[0]: EndpointConfig(API_VERSION)}
        return options, networks[1:]
