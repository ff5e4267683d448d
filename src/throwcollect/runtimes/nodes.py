"""Nodes that are started, watched and ended, wherever they live: what all runtimes with nodes have in common."""

from __future__ import annotations

import re
import signal
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from throwcollect.config.run import RunConfig
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.runtimes.ports import format_endpoint
from throwcollect.runtimes.runtime import Place

if TYPE_CHECKING:
    # Whoever scales a run needs names of nodes, and not what takes long to import.
    from throwcollect.config.schema import Config
    from throwcollect.dataset.summary import Info

ROUTER = "router"
COORDINATOR = "coordinator"
LAUNCHER = "launcher"
"""Lives beside the nodes, never in a container."""


def simulation_name(index: int) -> str:
    """Name of a simulation's node, counted from 0."""
    return f"sim_{index}"


def simulation_name_of(host: str) -> str:
    """Name of the one simulation on a host, as in a container."""
    return "sim_" + re.sub(r"[^a-z0-9_]", "_", host.lower())


class Role(Enum):
    """What the end of a node means to its run."""

    VITAL = "the run ends if the node cannot be kept alive"
    EXPENDABLE = "the run goes on as long as one of these can be kept alive"
    MAIN = "the run is over when the node comes to its own end"


@dataclass(frozen=True)
class NodeSpec:
    """A node that a run is to have.

    Attributes:
        name: Its name.
        arguments: Arguments of the `throwcollect` command.
        role: What its end means to the run.
        core: Processor core that it is bound to; None for any.
        rest_s: Shortest time after which it is started again when it has ended [s].
    """

    name: str
    arguments: tuple[str, ...]
    role: Role
    core: int | None = None
    rest_s: float = 0.0


@dataclass(frozen=True)
class NodeExit:
    """A node that ended.

    Attributes:
        name: Its name.
        code: Exit code; None when it never ran.
        reason: How it ended, in words, such as ``exit code 3`` or ``ended by SIGKILL``.
        log: Last lines of what it printed.
    """

    name: str
    code: int | None
    reason: str
    log: str


class NodeHost(ABC):
    """A place where the nodes of one run live: it starts, watches and ends them.

    What to do about a node that ended, froze or hangs is not decided here, but by the `supervisor` for all places.

    Attributes:
        data: Directory of the dataset, as nodes see it.
        listen: Zenoh endpoint at which the router is to listen.
        cleared: Whether nothing of the run is left but the dataset, once it is closed.
        place: The run.
        config: Its configuration.
        logs: The log files of its nodes.
    """

    data: str
    listen: str
    cleared: bool
    place: Place
    config: Config
    logs: NodeLogs

    @property
    def connection(self) -> Connection | None:
        """How this process joins the run; None while there is no way to its router."""
        if (address := self.router_address()) is None:
            return None
        return self.connection_at(format_endpoint(self.listen.partition("/")[0], *address))

    def connection_at(self, endpoint: str) -> Connection:
        """The way into the run over an endpoint of its router."""
        return Connection(endpoint, self.place.key, self.config.run.domain_id, self.place.middleware)

    def open(self) -> tuple[str, ...]:
        """Make what the nodes need.

        Returns:
            Names of the nodes that a launcher that died has left, and that run on as nodes of this one.

        Raises:
            WorkerError: If that is impossible.
        """
        return ()

    def info(self) -> Info:
        """What the finished dataset holds.

        Raises:
            DatasetError: If it is not finished.
        """
        from throwcollect.dataset.inspect import info

        return info(self.place.directory)

    @abstractmethod
    def router_address(self) -> tuple[str, int] | None:
        """Host and port at which this process reaches the router; None while there is no way to it."""

    @abstractmethod
    def start(self, node: NodeSpec) -> None:
        """Start a node, or begin to; if it fails later, that is one of `exits`.

        Args:
            node: The node; none of its name runs.

        Raises:
            WorkerError: If it cannot be started.
        """

    @abstractmethod
    def handle(self, name: str) -> str | None:
        """Process or container id of a running node; None if it does not run (yet)."""

    @abstractmethod
    def running(self) -> tuple[str, ...]:
        """Names of the nodes whose end has not been reported yet."""

    @abstractmethod
    def exits(self) -> list[NodeExit]:
        """Nodes that ended since the last call.

        Raises:
            WorkerError: If nothing can be known of the nodes any more.
        """

    @abstractmethod
    def frozen(self) -> frozenset[str]:
        """Nodes that run but were stopped in their tracks: paused, or by SIGSTOP."""

    def ready(self, name: str) -> bool:
        """Whether a simulation of this name has ever been ready for trials."""
        return self.logs.said_ready(name)

    def log_tail(self, name: str) -> str:
        """Last lines that a node printed."""
        return self.logs.tail(name)

    @abstractmethod
    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node; one that has ended is left alone."""

    @abstractmethod
    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes and forget them: politely, then after `grace_s` [s] by force."""

    @abstractmethod
    def close(self) -> None:
        """End everything that still runs, and remove all that was made for the run but the dataset."""


def protocol_of(run: RunConfig, middleware: Middleware) -> str:
    """What the router of a run speaks: TLS, which nobody else has the key to, unless the run is open or on Fast DDS."""
    if run.open:
        return "tcp"
    return "udp" if middleware.is_fast_dds else "tls"


def node_environment(connection: Connection) -> Mapping[str, str]:
    """Environment variables of a node of a run.

    Args:
        connection: The way into the run's ROS graph.
    """
    return {**connection.environment(), **library_environment(connection.middleware)}


def library_environment(middleware: Middleware) -> Mapping[str, str]:
    """Environment variables that have to hold when a node imports its libraries.

    Args:
        middleware: What carries the messages of the run.
    """
    return {
        **middleware.environment(),
        # One process per core is the parallelism here; threads of numerical libraries would only fight it.
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
