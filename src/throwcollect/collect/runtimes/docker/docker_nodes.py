"""The host of runs whose nodes are containers of a Docker engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ipaddress import ip_network
from typing import Any

from docker.client import DockerClient
from docker.types import IPAMConfig, IPAMPool

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

_ROUTER_HOST = -2
"""Index of the last address of a range, except for that of broadcasts."""


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
            self._create_network()
        super().open()

    def _create_network(self) -> None:
        """Make the run's network; on Fast DDS, the router has to be able to keep its address there.

        Nodes on Fast DDS look up the address of their discovery server only once. A container can choose its address
        only in a network whose range was named, so a first network serves to find a free range.
        """
        name = name_network(self.record.run)
        options = {"driver": "bridge", "internal": not publishes_port(self.config), "labels": make_labels(self.record)}
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
            network = self._client.networks.get(name_network(self.record.run))
        # The engine hands out addresses from the beginning of the range, so an address at its end stays free.
        return str(ip_network(network.attrs["IPAM"]["Config"][0]["Subnet"])[_ROUTER_HOST])

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
        address = self._address_of(node)
        options = make_node_options(
            node, record=self.record, config=self.config, image_id=self._image_id, address=address
        )
        return options, self.find_section(node.name).networks
