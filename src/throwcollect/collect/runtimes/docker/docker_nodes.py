"""The host of runs whose nodes are containers of a Docker engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from docker.client import DockerClient

from throwcollect.collect.runtimes.docker.checks import check
from throwcollect.collect.runtimes.docker.container_options import (
    DATA,
    ROUTER_PORT,
    find_section,
    make_labels,
    make_node_options,
    make_router_endpoint,
    name_network,
    publishes_port,
)
from throwcollect.collect.runtimes.docker.containers import ANSWER_S, ContainerHost
from throwcollect.collect.runtimes.docker.docker_engine import connect, engine_errors
from throwcollect.collect.runtimes.nodes import ROUTER, NodeSpec, choose_protocol
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.run import NodeContainerConfig
from throwcollect.config.schema import Config
from throwcollect.ros.router_endpoint import LOOPBACK, format_endpoint


class DockerNodes(ContainerHost):
    """Runs nodes as containers that can do little but compute, in a network of their own; see `nodes.NodeHost`.

    Args:
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
        super().__init__(record, config, client or connect(timeout_s=ANSWER_S), warn)
        self.listen = make_router_endpoint(config, record.middleware)
        self.data = DATA
        self._image_id = check(self._client, config)

    def find_section(self, name: str) -> NodeContainerConfig:
        """See `ContainerHost.find_section`."""
        return find_section(self.config, name)

    def open(self) -> None:
        """Make the run's network, and watch its containers; see `NodeHost.open`."""
        hint = "throwcollect ps shows the runs that there are; throwcollect down removes one"
        with engine_errors(f"run {self.record.run} cannot be prepared on the Docker engine", hint=hint):
            self._client.networks.create(
                name_network(self.record.run),
                driver="bridge",
                internal=not publishes_port(self.config),
                labels=make_labels(self.record),
            )
        super().open()

    @property
    def endpoint(self) -> str | None:
        """See `NodeHost.endpoint`."""
        router = self.containers.get(ROUTER)
        if router is None or router.status == "created" or router.ended:
            return None
        protocol = choose_protocol(self.config.run, self.record.middleware)
        if self.config.run.router_port:
            return format_endpoint(protocol, LOOPBACK, self.config.run.router_port)
        return format_endpoint(protocol, router.address, ROUTER_PORT) if router.address else None

    def make_options(self, node: NodeSpec) -> tuple[dict[str, Any], Sequence[str]]:
        """See `ContainerHost.make_options`."""
        options = make_node_options(node, record=self.record, config=self.config, image_id=self._image_id)
        return options, self.find_section(node.name).networks
