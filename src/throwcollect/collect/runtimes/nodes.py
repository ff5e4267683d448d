"""The interface of hosts that start, watch and end nodes, and what all of these hosts have in common."""

from __future__ import annotations

import os
import re
import signal
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.config.run import RunConfig
from throwcollect.own_process import SERIAL_LIBRARIES
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware

if TYPE_CHECKING:
    # Modules that need only the names of nodes should not wait for these imports.
    from throwcollect.config.schema import Config

ROUTER = "router"
COORDINATOR = "coordinator"
CONTAINER = "container"
"""Name of the only node of a run that is a container of the catalogue."""
LAUNCHER = "launcher"
"""Name of the launcher's node; the launcher never runs in a container."""
SIMULATIONS = "simulations"
"""Name of the launcher's parameter with the number of simulations."""
CONFIGURATION = "configuration"
"""Name of the launcher's parameter that holds the configuration as a string, for machines that join."""
ROBOT_FILES = "robot_files"
"""Name of the launcher's parameter that holds the files of a robot that is not installed, see `pack_robot`."""


_SIMULATION = "sim_"


def name_simulation(index: int) -> str:
    """Name of a simulation's node, counted from 0."""
    return f"{_SIMULATION}{index}"


def name_simulation_on(host: str) -> str:
    """Name of the only simulation on a host, as in a container."""
    return _SIMULATION + re.sub(r"[^a-z0-9_]", "_", host.lower())


def is_simulation(name: str) -> bool:
    """Whether a node of this name is a simulation."""
    return name.startswith(_SIMULATION)


class NodeRole(Enum):
    """The consequence that the end of a node has for the run."""

    VITAL = "the run ends if the node cannot be kept alive"
    EXPENDABLE = "the run goes on as long as one of these can be kept alive"
    MAIN = "the run is over when the node comes to its own end"


@dataclass(frozen=True)
class NodeSpec:
    """A node that a run is to have.

    Attributes:
        arguments: Arguments of the `throwcollect` command.
        core: Processor core to which the node is bound; None for any.
        rest_s: Shortest time between the end of the node and its next start [s].
    """

    name: str
    arguments: tuple[str, ...]
    role: NodeRole
    core: int | None = None
    rest_s: float = 0.0


def list_simulations(names: Sequence[str], data: str, *, recordings: str | None = None) -> list[NodeSpec]:
    """Simulations of these names, for the configuration in the directory `data`; each records for itself, if at all."""
    cores = sorted(os.sched_getaffinity(0))
    # Where simulations fill all cores, letting them move between cores was measured to cost a tenth of the speed.
    bound = len(names) >= len(cores)
    return [
        NodeSpec(
            name,
            ("sim", f"{data}/config.yaml", "--name", name)
            + (("--record", f"{recordings}/{name}") if recordings is not None else ()),
            NodeRole.EXPENDABLE,
            core=cores[index % len(cores)] if bound else None,
        )
        for index, name in enumerate(names)
    ]


@dataclass(frozen=True)
class NodeExit:
    """A node that ended.

    Attributes:
        code: Exit code; None if the node never ran.
        reason: How the node ended, in words, such as ``exit code 3`` or ``ended by SIGKILL``.
        log: Last lines that the node printed.
    """

    name: str
    code: int | None
    reason: str
    log: str


def describe_end(code: int) -> str:
    """How a node ended, for `NodeExit.reason`; a code below 0 is the number of the signal that ended it, negated."""
    if code >= 0:
        return f"exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        # Signals in real time have no names, but for the first and the last one.
        name = f"signal {-code}"
    return f"ended by {name}"


class NodeHost(ABC):
    """Starts, watches and ends the nodes of one run.

    A host does not decide what to do about a node that ended, froze or hangs: the `supervisor` does, for all hosts.

    Attributes:
        data: Directory of the dataset, as nodes see it.
        listen: Zenoh endpoint at which the router is to listen.
        cleared: As for `runtime.Host`.
    """

    data: str
    listen: str
    cleared: bool
    record: RunRecord
    config: Config
    logs: NodeLogs

    @property
    def connection(self) -> Connection | None:
        """The connection with which this process joins the run; None while it cannot reach the router."""
        if (endpoint := self.endpoint) is None:
            return None
        return Connection(endpoint, self.record.key, self.config.run.domain_id, self.record.middleware)

    def open(self) -> None:
        """Make everything that the nodes need, such as a network, and skip what earlier runs have logged."""
        self.logs.skip_earlier()

    @property
    @abstractmethod
    def endpoint(self) -> str | None:
        """Zenoh endpoint at which this process reaches the router; None while it cannot."""

    @abstractmethod
    def start(self, node: NodeSpec) -> None:
        """Start a node, or begin to, if no node of its name runs; a start that fails later appears in `exits`."""

    @abstractmethod
    def handle(self, name: str) -> str | None:
        """Process or container id of a running node; None if the node does not run (yet)."""

    @abstractmethod
    def running(self) -> tuple[str, ...]:
        """Names of the nodes whose end `exits` has not reported yet."""

    @abstractmethod
    def exits(self) -> list[NodeExit]:
        """The nodes that ended since the last call."""

    @abstractmethod
    def frozen(self) -> frozenset[str]:
        """Names of the nodes that are paused or were stopped by SIGSTOP."""

    @abstractmethod
    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node, unless it has ended."""

    @abstractmethod
    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes and forget them: with SIGTERM, then after `grace_s` [s] by force."""

    @abstractmethod
    def close(self) -> None:
        """See `runtime.Host.close`."""


def choose_protocol(run: RunConfig, middleware: Middleware) -> str:
    """Protocol of a run's router: TLS, for which others have no key, unless the run is open or on Fast DDS."""
    if run.open:
        return "tcp"
    return "udp" if middleware.is_fast_dds else "tls"


def make_environment(connection: Connection) -> Mapping[str, str]:
    """Environment variables of a node that joins a run over this connection."""
    return {**connection.environment(), **SERIAL_LIBRARIES}
