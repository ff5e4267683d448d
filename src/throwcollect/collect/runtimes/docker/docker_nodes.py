"""The host of runs whose nodes are containers of a Docker engine."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from ipaddress import ip_network

from docker.client import DockerClient
from docker.types import IPAMConfig, IPAMPool

from throwcollect.collect.runtimes.docker.checks import check
from throwcollect.collect.runtimes.docker.container_options import (
    DATA,
    ROUTER_PORT,
    container_of,
    labels,
    network_of,
    node_options,
    publishes_port,
    router_endpoint,
    section_of,
)
from throwcollect.collect.runtimes.docker.containers import ANSWER_S, Container, Containers, ContainerState
from throwcollect.collect.runtimes.docker.docker_engine import ENGINE_ERRORS, connect, engine_errors
from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import ROUTER, NodeExit, NodeHost, NodeSpec, describe_end, protocol_of
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.runtime import Session
from throwcollect.config.schema import Config
from throwcollect.dataset.summary import Info
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.ros.router_endpoint import LOOPBACK, format_endpoint
from throwcollect.wording import command

_ROUTER_HOST = -2
"""Index of the last address of a range, except for that of broadcasts."""
_SIGNALLED = 128
"""Exit codes above this are those of a signal."""


class DockerNodes(NodeHost):
    """Runs nodes as containers that can do little but compute; see `nodes.NodeHost`.

    Containers and networks carry the run's id as a label, by which `down` finds them if the launcher dies.

    Args:
        record: The run; its id has to be unique on the engine.
        warn: Gets a line when the engine is silent for long.
        client: Client of the engine; None connects to the one that `engine_address` finds.
    """

    def __init__(
        self,
        record: RunRecord,
        config: Config,
        *,
        warn: Callable[[str], None] = lambda _line: None,
        client: DockerClient | None = None,
    ) -> None:
        self.record = record
        self.config = config
        self.listen = router_endpoint(config, record.middleware)
        self.cleared = False
        self.data = DATA
        self.logs = NodeLogs(record.logs)
        self._client = client or connect(timeout_s=ANSWER_S)
        self._image_id = check(self._client, config)
        self._containers = Containers(self._client, record.run, self.logs, warn)

    def collect(self, session: Session) -> Info | None:
        """See `runtime.Host.collect`."""
        # This imports ROS, so it has to wait until the backend is chosen.
        from throwcollect.collect.runtimes.node_collection import NodeCollection

        return NodeCollection(self, session).run_to_the_end()

    def open(self) -> None:
        """Make the run's network, and watch its containers; see `NodeHost.open`."""
        hint = "throwcollect ps shows the runs that there are; throwcollect down removes one"
        with engine_errors(f"run {self.record.run} cannot be prepared on the Docker engine", hint=hint):
            self._create_network()
        super().open()
        self._containers.open()

    def _create_network(self) -> None:
        """Make the run's network; on Fast DDS, the router has to be able to keep its address there.

        Nodes on Fast DDS look up the address of their discovery server only once. A container can choose its address
        only in a network whose range was named, so a first network serves to find a free range.
        """
        name = network_of(self.record.run)
        options = {"driver": "bridge", "internal": not publishes_port(self.config), "labels": labels(self.record)}
        network = self._client.networks.create(name, **options)
        if self.record.middleware.is_fast_dds:
            network.reload()
            pool = IPAMPool(subnet=network.attrs["IPAM"]["Config"][0]["Subnet"])
            network.remove()
            self._client.networks.create(name, ipam=IPAMConfig(pool_configs=[pool]), **options)

    def _address_of(self, node: NodeSpec) -> str | None:
        """The address that a node is to have in the run's network; None if it may be any."""
        if node.name != ROUTER or not self.record.middleware.is_fast_dds:
            return None
        with engine_errors("the engine does not report which addresses the run's network has"):
            network = self._client.networks.get(network_of(self.record.run))
        # The engine hands out addresses from the beginning of the range, so an address at its end stays free.
        return str(ip_network(network.attrs["IPAM"]["Config"][0]["Subnet"])[_ROUTER_HOST])

    @property
    def endpoint(self) -> str | None:
        """See `NodeHost.endpoint`."""
        router = self._containers.by_node.get(ROUTER)
        state = None if router is None else router.state
        if state is None or state.ended:
            return None
        protocol = protocol_of(self.config.run, self.record.middleware)
        if self.config.run.router_port:
            return format_endpoint(protocol, LOOPBACK, self.config.run.router_port)
        return format_endpoint(protocol, state.address, ROUTER_PORT) if state.address else None

    def start(self, node: NodeSpec) -> None:
        """Begin to start a node; if it cannot be started, one of the next `exits` reports it."""
        options = node_options(
            node,
            record=self.record,
            config=self.config,
            image_id=self._image_id,
            address=self._address_of(node),
        )
        self._containers.start(node.name, options, networks=section_of(self.config, node.name).networks)

    def handle(self, name: str) -> str | None:
        """Short id of a running node's container; None if the container does not run (yet)."""
        container = self._containers.by_node.get(name)
        return container.id[:12] if container is not None and container.id is not None else None

    def running(self) -> tuple[str, ...]:
        """See `NodeHost.running`."""
        return tuple(self._containers.by_node)

    def exits(self) -> list[NodeExit]:
        """The nodes that ended, or could not be started, since the last call."""
        self._containers.warn_if_silent()
        if self._containers.given_up:
            raise self._make_silence_error()
        ends = [end for each in self._containers.by_node.values() if (end := self._find_end(each)) is not None]
        for end in ends:
            del self._containers.by_node[end.name]
        return ends

    def frozen(self) -> frozenset[str]:
        """Names of the nodes whose containers are paused."""
        return frozenset(name for name, container in self._containers.by_node.items() if container.paused)

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node once it runs, unless it has ended."""
        # A node that is not there, or cannot be started, gets none.
        with suppress(KeyError, *ENGINE_ERRORS):
            self._client.api.kill(self._containers.by_node[name].starting.result(), int(number))

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes and remove their containers: with SIGTERM, then after `grace_s`, in whole seconds, by force."""
        self._containers.remove(names, grace_s=grace_s)

    def close(self) -> None:
        """End all nodes, the router last, and remove everything that was made for the run.

        Afterwards, `cleared` is true if the engine has removed all containers.
        """
        self.cleared = self._containers.close()

    def _make_silence_error(self) -> WorkerError:
        """The error of a silent engine, with the containers that may still run there, and how to go on."""
        record = self.record
        left = ", ".join(container_of(record.run, node) for node in self._containers.by_node) or "none"
        hint = (
            f"once it answers, {command('down', '--run', record.run)} ends them, "
            f"and {command('resume', record.directory)} goes on without them"
        )
        return WorkerError(
            f"the Docker engine has not answered for {self._containers.silent_s:.0f} s; "
            f"finished throws are safe in {record.directory}",
            evidence="\n".join(filter(None, (self._containers.last_error, f"containers that may run on: {left}"))),
            hint=hint,
        )

    def _find_end(self, container: Container) -> NodeExit | None:
        """How a node ended; None while it runs."""
        name, state = container.node, container.state
        if (failure := container.failure) is not None:
            return NodeExit(name, None, f"cannot be started: {failure}", self.logs.tail(name))
        if state is None or not state.ended:
            return None
        reason = describe_container_end(state, section_of(self.config, name).memory)
        return NodeExit(name, state.code, reason, self.logs.tail(name))


def describe_container_end(state: ContainerState, memory: str | None) -> str:
    """How a container with this memory limit ended."""
    if state.code is None:
        return "its container was removed"
    # `out_of_memory` alone proves nothing: the kernel may have killed another process, and the container went on.
    if state.out_of_memory and state.code == _SIGNALLED + signal.SIGKILL:
        return "ran out of memory" + (f" (limit {memory})" if memory else "")
    number = state.code - _SIGNALLED
    signalled = number in signal.valid_signals() and state.code != Interrupted.exit_code
    return describe_end(-number if signalled else state.code)
