"""What every runtime offers: nodes that are started, watched and ended, wherever they live."""

from __future__ import annotations

import re
import signal
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from throwcollect.config.run import RunConfig
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.session_config import OVERRIDE_VARIABLE, client_override
from throwcollect.run_key import KEY_VARIABLE, RunKey

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


class Runtime(Protocol):
    """A place where the nodes of one run live.

    Attributes:
        data: Directory of the dataset, as nodes see it.
        listen: Zenoh endpoint at which the router is to listen.
        cleared: Whether nothing of the run is left but the dataset, once it is closed.
    """

    data: str
    listen: str
    cleared: bool

    def router_address(self) -> tuple[str, int] | None:
        """Host and port at which this process reaches the router; None while there is no way to it."""

    def start(self, name: str, arguments: Sequence[str], *, core: int | None = None) -> None:
        """Start a node, or begin to; if it fails later, that is one of `exits`.

        Args:
            name: Its name; not one that runs.
            arguments: Arguments of the `throwcollect` command.
            core: Processor core that it is bound to; None for any.

        Raises:
            WorkerError: If it cannot be started.
        """

    def handle(self, name: str) -> str | None:
        """Process or container id of a running node; None if it does not run (yet)."""

    def running(self) -> tuple[str, ...]:
        """Names of the nodes whose end has not been reported yet."""

    def exits(self) -> list[NodeExit]:
        """Nodes that ended since the last call.

        Raises:
            WorkerError: If nothing can be known of the nodes any more.
        """

    def frozen(self) -> frozenset[str]:
        """Nodes that run but were stopped in their tracks: paused, or by SIGSTOP."""

    def ready(self, name: str) -> bool:
        """Whether a simulation of this name has ever been ready for trials."""

    def log_tail(self, name: str) -> str:
        """Last lines that a node printed."""

    def signal(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a node; one that has ended is left alone."""

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """End nodes and forget them: politely, then after `grace_s` [s] by force."""

    def close(self) -> None:
        """End everything that still runs, and remove all that was made for the run but the dataset."""


def endpoint_of(runtime: Runtime) -> str | None:
    """Zenoh endpoint at which this process reaches the router of a runtime; None while there is no way to it."""
    address = runtime.router_address()
    if address is None:
        return None
    protocol = runtime.listen.partition("/")[0]
    return "{}/{}:{}".format(protocol, *address)


def protocol_of(run: RunConfig, middleware: Middleware) -> str:
    """What the router of a run speaks: TLS, which nobody else has the key to, unless the run is open or on Fast DDS."""
    if run.open:
        return "tcp"
    return "udp" if middleware.is_fast_dds else "tls"


def joining_environment(endpoint: str, domain_id: int, key: RunKey, middleware: Middleware) -> Mapping[str, str]:
    """Environment variables by which a process of ours joins a run; they name the key's files and hold no secret.

    Args:
        endpoint: Endpoint of the router.
        domain_id: ROS domain.
        key: Key of the run.
        middleware: What carries the run's messages.
    """
    return {
        **middleware.environment(),
        OVERRIDE_VARIABLE: client_override(endpoint, key),
        "ROS_DOMAIN_ID": str(domain_id),
        KEY_VARIABLE: str(key.directory),
    }


def node_environment(endpoint: str, domain_id: int, key: RunKey, middleware: Middleware) -> Mapping[str, str]:
    """Environment variables of a node of a run; arguments as `joining_environment`."""
    return {
        **joining_environment(endpoint, domain_id, key, middleware),
        # One process per core is the parallelism here; threads of numerical libraries would only fight it.
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
