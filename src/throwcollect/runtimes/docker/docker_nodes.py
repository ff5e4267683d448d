"""The host of runs whose nodes are containers of a Docker engine."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from ipaddress import ip_network

from docker.client import DockerClient
from docker.errors import NotFound
from docker.types import IPAMConfig, IPAMPool

from throwcollect.config.schema import Config
from throwcollect.dataset.summary import Info
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.ros.router_endpoint import LOOPBACK, format_endpoint
from throwcollect.runtimes.docker import watch
from throwcollect.runtimes.docker.checks import check
from throwcollect.runtimes.docker.container_options import (
    NODE_LABEL,
    ROUTER_PORT,
    RUN_LABEL,
    RunPlace,
    node_options,
    publishes_port,
    router_endpoint,
    section_of,
)
from throwcollect.runtimes.docker.docker_engine import ENGINE_ERRORS, connect, engine_errors
from throwcollect.runtimes.docker.held_runs import remove
from throwcollect.runtimes.docker.node_container import LOG_S, NodeContainer
from throwcollect.runtimes.docker.volume import dataset_info, place_directory, place_key
from throwcollect.runtimes.docker.watch import ContainerState, EngineClock, EngineWatch
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.runtimes.nodes import ROUTER, NodeExit, NodeHost, NodeSpec, describe_end, protocol_of
from throwcollect.runtimes.runtime import Place, Session
from throwcollect.wording import command

_BEGIN_S = 30.0
"""Time to wait for the start of a container; only the end of a run waits longer."""
_POLL_S = 0.2
_ROUTER_HOST = -2
"""Index of the last address of a range, except for that of broadcasts."""
_AT_ONCE = 8
_SIGNALLED = 128
"""Exit codes above this are those of a signal."""


class DockerNodes(NodeHost):
    """Runs nodes as containers that can do little but compute; see `nodes.NodeHost`.

    Containers, networks and volumes carry the run's id as a label, by which another process finds them again.

    Args:
        place: The place of the run; its id has to be unique on the engine.
        warn: Gets a line of text when the engine is silent for long.
        client: Client of the engine; None connects to the one that `engine_address` finds.

    Raises:
        ConfigError: If a mount or a network of the configuration does not exist, or a port is taken.
        WorkerError: If no engine answers, or it does not have the image.
    """

    def __init__(
        self,
        place: Place,
        config: Config,
        *,
        warn: Callable[[str], None] = lambda _line: None,
        client: DockerClient | None = None,
    ) -> None:
        self.place = place
        self.config = config
        self.listen = router_endpoint(config, place.middleware)
        self.cleared = False
        self._place = RunPlace(place.run, place.volume or str(place.directory.resolve()))
        self.data = self._place.data
        self.logs = NodeLogs(place.logs)
        self._watch: EngineWatch | None = None
        self._nodes: dict[str, NodeContainer] = {}
        self._beginning: list[NodeContainer] = []
        self._ended_at: dict[str, float] = {}
        with ExitStack() as undo:
            self._clock = EngineClock(warn)
            # The clock has a thread, which would go on counting and warning if making this host failed.
            undo.callback(self._clock.close)
            self._client = client or connect(timeout_s=watch.SILENCE_S)
            self._clock.attend(self._client)
            self._image_id = check(self._client, self._place, config)
            undo.pop_all()

    def collect(self, session: Session) -> Info | None:
        """See `runtime.Host.collect`."""
        # This imports ROS, so it has to wait until the backend is chosen.
        from throwcollect.runtimes.node_collection import NodeCollection

        return NodeCollection(self, session).run_to_the_end()

    def open(self) -> tuple[str, ...]:
        """Make the run's network and volumes if they do not exist, watch its containers, and take over existing ones.

        Returns:
            Names of the nodes whose containers exist already; the next `exits` reports those that have ended.
        """
        place = self._place
        hint = "throwcollect ps shows the runs that there are; throwcollect down removes one"
        with engine_errors(f"run {place.run_id} cannot be prepared on the Docker engine", hint=hint):
            if place.in_volume:
                try:
                    self._client.volumes.get(place.source)
                except NotFound:
                    self._client.volumes.create(place.source, labels=place.labels())
            # If the network exists, an earlier launcher made it and the volume with the key, and its nodes use both.
            if not self._client.networks.list(filters={"label": f"{RUN_LABEL}={place.run_id}"}):
                # Both steps wait for the engine, so they are done side by side.
                with ThreadPoolExecutor(1) as pool:
                    placing = pool.submit(place_key, self._client, place, self.config, self.place.key)
                    self._create_network()
                    placing.result()
        self._watch = EngineWatch(self._client, place, self._clock)
        found = self._adopt()
        if not found:
            self.logs.skip_earlier()
        if place.in_volume and not found:
            place_directory(self._client, place, self.config, self.place.directory)
        return found

    def _create_network(self) -> None:
        """Make the run's network; on Fast DDS, the router has to be able to keep its address there.

        Nodes on Fast DDS look up the address of their discovery server only once. A container can choose its address
        only in a network whose range was named, so a first network serves to find a free range.
        """
        place = self._place
        options = {"driver": "bridge", "internal": not publishes_port(self.config), "labels": place.labels()}
        network = self._client.networks.create(place.network, **options)
        if self.place.middleware.is_fast_dds:
            network.reload()
            pool = IPAMPool(subnet=network.attrs["IPAM"]["Config"][0]["Subnet"])
            network.remove()
            self._client.networks.create(place.network, ipam=IPAMConfig(pool_configs=[pool]), **options)

    def _address_of(self, node: NodeSpec) -> str | None:
        """The address that a node is to have in the run's network; None if it may be any."""
        if node.name != ROUTER or not self.place.middleware.is_fast_dds:
            return None
        with engine_errors("the engine does not say which addresses the run's network has"):
            network = self._client.networks.get(self._place.network)
        # The engine hands out addresses from the beginning of the range, so an address at its end stays free.
        return str(ip_network(network.attrs["IPAM"]["Config"][0]["Subnet"])[_ROUTER_HOST])

    def _adopt(self) -> tuple[str, ...]:
        """Take over the containers of a launcher that died, and return the names of their nodes."""
        filters = {"label": [f"{RUN_LABEL}={self._place.run_id}", NODE_LABEL]}
        with engine_errors(f"the nodes of run {self._place.run_id} cannot be found"):
            for container in self._client.containers.list(all=True, filters=filters):
                name = container.labels[NODE_LABEL]
                # `start` replaces a container that was created but never started.
                if name not in self._nodes and container.status != "created":
                    # The next `exits` has to know the state: a container that has ended sends no further event.
                    self._opened.look(container.id)
                    self._nodes[name] = self._node(name)
                    self._nodes[name].adopt(container)
        return self.running()

    def info(self) -> Info:
        """Read the summary of the finished dataset."""
        return dataset_info(self._client, self._place, self.config) if self._place.in_volume else super().info()

    @property
    def endpoint(self) -> str | None:
        """See `NodeHost.endpoint`."""
        state = self._state(ROUTER)
        if state is None or state.ended:
            return None
        protocol = protocol_of(self.config.run, self.place.middleware)
        if self.config.run.router_port:
            return format_endpoint(protocol, LOOPBACK, self.config.run.router_port)
        return format_endpoint(protocol, state.address, ROUTER_PORT) if state.address else None

    def start(self, node: NodeSpec) -> None:
        """Begin to start a node; if it cannot be started, one of the next `exits` reports it."""
        options = node_options(
            node,
            place=self._place,
            config=self.config,
            middleware=self.place.middleware,
            image_id=self._image_id,
            address=self._address_of(node),
        )
        container = self._nodes[node.name] = self._node(node.name)
        container.start(options, networks=section_of(self.config, node.name).networks)

    def handle(self, name: str) -> str | None:
        """Short id of a running node's container; None if the container does not run (yet)."""
        node = self._nodes.get(name)
        return node.handle[:12] if node and node.handle else None

    def running(self) -> tuple[str, ...]:
        """See `NodeHost.running`."""
        return tuple(self._nodes)

    def exits(self) -> list[NodeExit]:
        """The nodes that ended, or could not be started, since the last call."""
        if self._clock.given_up:
            raise self._make_silence_error()
        ends = [end for node in self._nodes.values() if (end := self._find_end(node)) is not None]
        for end in ends:
            del self._nodes[end.name]
        return ends

    def frozen(self) -> frozenset[str]:
        """Names of the nodes whose containers are paused."""
        return frozenset(name for name in self._nodes if (state := self._state(name)) and state.status == "paused")

    def ready(self, name: str) -> bool:
        """Whether a simulation has ever announced that it is ready, or passes its health check."""
        state = self._state(name)
        return (state is not None and state.healthy) or self.logs.said_ready(name)

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node once it runs, unless it has ended."""
        if (node := self._nodes.get(name)) is None:
            return
        node.wait_begun(_BEGIN_S)
        if node.handle is not None:
            with suppress(*ENGINE_ERRORS):
                self._client.api.kill(node.handle, int(number))

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes and remove their containers: with SIGTERM, then after `grace_s`, in whole seconds, by force."""
        nodes = [self._nodes.pop(name) for name in names if name in self._nodes]
        # The engine cannot end a container that it is still starting; `close` waits for such a container.
        self._beginning += [node for node in nodes if not node.begun]
        with ThreadPoolExecutor(_AT_ONCE) as pool:
            for node in nodes:
                pool.submit(self._end, node, math.ceil(grace_s))

    def close(self) -> None:
        """End all nodes, the router last, and remove everything that was made for the run but its volume.

        Afterwards, `cleared` tells whether the engine has removed all containers.
        """
        if not self._clock.given_up:
            self.stop([name for name in self._nodes if name != ROUTER])
            self.stop([ROUTER])
        while not self._clock.given_up and any(not node.wait_begun(_POLL_S) for node in self._beginning):
            pass
        if not self._clock.given_up:
            self._remove()
        if self._watch is not None:
            self._watch.close()
        self._clock.close()
        for node in self._nodes.values():
            node.close()

    def _remove(self) -> None:
        # The network cannot be removed while somebody else's container is in it.
        with suppress(WorkerError):
            remove(self._client, self._place.run_id, volumes=False)
        filters = {"label": [f"{RUN_LABEL}={self._place.run_id}", NODE_LABEL]}
        with suppress(*ENGINE_ERRORS):
            self.cleared = not self._client.api.containers(all=True, filters=filters)

    def _make_silence_error(self) -> WorkerError:
        """The error of a silent engine, with the containers that may still run there, and how to go on."""
        place = self._place
        left = ", ".join(map(place.container, self._nodes)) or "none"
        hint = f"once it answers, {command('down', '--run', place.run_id)} ends them"
        if not place.in_volume:
            hint += f", and {command('resume', place.source)} goes on with them"
        return WorkerError(
            f"the Docker engine has not answered for {self._clock.silent_s:.0f} s; "
            f"finished throws are safe in {place.source}",
            evidence="\n".join(filter(None, (self._opened.last_error, f"containers that may run on: {left}"))),
            hint=hint,
        )

    def _node(self, name: str) -> NodeContainer:
        return NodeContainer(self._client, name, self.logs.path(name), self._clock)

    @property
    def _opened(self) -> EngineWatch:
        if self._watch is None:
            raise WorkerError(f"run {self._place.run_id} is not open on the Docker engine")
        return self._watch

    def _state(self, name: str) -> ContainerState | None:
        node = self._nodes.get(name)
        return self._opened.state(node.handle) if node else None

    def _find_end(self, node: NodeContainer) -> NodeExit | None:
        """How a node ended; None while it runs, or its last lines are not yet in its log."""
        if node.failure is not None:
            return NodeExit(node.name, None, f"cannot be started: {node.failure}", self.logs.tail(node.name))
        state = self._opened.state(node.handle)
        if state is None or not state.ended:
            self._ended_at.pop(node.name, None)
            return None
        now = time.monotonic()
        if not node.log_complete and now - self._ended_at.setdefault(node.name, now) < LOG_S:
            return None
        self._ended_at.pop(node.name, None)
        memory = section_of(self.config, node.name).memory
        return NodeExit(node.name, state.code, end_in_words(state, memory), self.logs.tail(node.name))

    def _end(self, node: NodeContainer, grace_s: int) -> None:
        if not node.wait_begun(_BEGIN_S):
            node.renounce()
        node.end(grace_s)


def end_in_words(state: ContainerState, memory: str | None) -> str:
    """Say in words how a container with this memory limit ended."""
    if state.code is None:
        return "its container was removed"
    # `out_of_memory` alone proves nothing: the kernel may have killed another process, and the container went on.
    if state.out_of_memory and state.code == _SIGNALLED + signal.SIGKILL:
        return "ran out of memory" + (f" (limit {memory})" if memory else "")
    number = state.code - _SIGNALLED
    signalled = number in signal.valid_signals() and state.code != Interrupted.exit_code
    return describe_end(-number if signalled else state.code)
