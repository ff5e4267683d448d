"""The runtime ``local``: nodes as processes of this machine."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.node_process import start_process
from throwcollect.collect.runtimes.nodes import (
    ROUTER,
    NodeExit,
    NodeHost,
    NodeSpec,
    describe_end,
    node_environment,
    protocol_of,
)
from throwcollect.collect.runtimes.runtime import RunContext, Runtime, Session
from throwcollect.errors import WorkerError
from throwcollect.files import open_log
from throwcollect.own_process import make_command
from throwcollect.ros.connection import Connection
from throwcollect.ros.router_endpoint import format_endpoint, reach_from_here, reserve_port

if TYPE_CHECKING:
    from throwcollect.config.schema import Config
    from throwcollect.dataset.summary import Info

_KILLED_S = 5.0
"""Time that a process has to end after SIGKILL."""


class LocalRuntime(Runtime):
    """Nodes as child processes of the launcher."""

    def describe(self, config: Config) -> str:
        """See `Runtime.describe`."""
        return "local processes"

    def host(self, context: RunContext, config: Config, *, warn: Callable[[str], None]) -> LocalNodes:
        """Make the host of a run; see `Runtime.host`."""
        return LocalNodes(context, config)


class LocalNodes(NodeHost):
    """Runs nodes as processes, each with a log file of its own; see `nodes.NodeHost`.

    They live in sessions of their own, so that Ctrl-C reaches only the launcher. The kernel ends them when the launcher
    dies.

    Args:
        elsewhere: Endpoint of a router on another machine; None if the router is one of the nodes.

    Raises:
        ConfigError: If the router's port is taken.
    """

    cleared = True

    def __init__(self, context: RunContext, config: Config, *, elsewhere: str | None = None) -> None:
        self.context = context
        self.config = config
        self.data = str(context.directory)
        self.logs = NodeLogs(context.logs)
        self._reserved: socket.socket | None = None
        if elsewhere is not None:
            self.listen = self._endpoint = elsewhere
        else:
            self._reserved = reserve_port(config.run)
            host, port = self._reserved.getsockname()[:2]
            protocol = protocol_of(config.run, context.middleware)
            self.listen = format_endpoint(protocol, host, port)
            self._endpoint = format_endpoint(protocol, reach_from_here(host), port)
        connection = Connection(self._endpoint, context.key, config.run.domain_id, context.middleware)
        self._environment = {**os.environ, **node_environment(connection)}
        self._processes: dict[str, BaseProcess] = {}

    def collect(self, session: Session) -> Info | None:
        """See `runtime.Host.collect`."""
        # This imports ROS, so it has to wait until the backend is chosen.
        from throwcollect.collect.runtimes.node_collection import NodeCollection

        return NodeCollection(self, session).run_to_the_end()

    @property
    def endpoint(self) -> str:
        """See `NodeHost.endpoint`."""
        return self._endpoint

    def start(self, node: NodeSpec) -> None:
        """Start a node."""
        # Until now, this process has reserved the port, so that no other process takes it. The router needs it now.
        if node.name == ROUTER and self._reserved is not None:
            self._reserved.close()
        try:
            log = self.logs.path(node.name)
            os.close(open_log(log))
            self._processes[node.name] = start_process(
                [*make_command(), *node.arguments], self._environment, log, core=node.core
            )
        except OSError as error:
            raise WorkerError(f"{node.name}: cannot be started: {error}") from error

    def handle(self, name: str) -> str | None:
        """Process id of a running node; None if the node does not run."""
        process = self._processes.get(name)
        return None if process is None else str(process.pid)

    def running(self) -> tuple[str, ...]:
        """See `NodeHost.running`."""
        return tuple(self._processes)

    def exits(self) -> list[NodeExit]:
        """See `NodeHost.exits`."""
        ended = [(name, code) for name, process in self._processes.items() if (code := process.exitcode) is not None]
        for name, _ in ended:
            del self._processes[name]
        return [NodeExit(name, code, describe_end(code), self.logs.tail(name)) for name, code in ended]

    def frozen(self) -> frozenset[str]:
        """Names of the nodes that a signal has stopped, and none has continued."""
        return frozenset(name for name, process in self._processes.items() if _is_stopped(process.pid))

    def signal(self, name: str, number: signal.Signals) -> None:
        """See `NodeHost.signal`."""
        process = self._processes.get(name)
        if process is not None and process.pid is not None and process.exitcode is None:
            with suppress(ProcessLookupError):
                os.kill(process.pid, number)

    def stop(self, names: Sequence[str], *, grace_s: float = 3.0) -> None:
        """See `NodeHost.stop`."""
        # All nodes get the signal first, so that they end at the same time and share one grace period.
        for name in names:
            self.signal(name, signal.SIGTERM)
        deadline = time.monotonic() + grace_s
        for name in names:
            process = self._processes.pop(name, None)
            if process is None:
                continue
            process.join(max(0.0, deadline - time.monotonic()))
            if process.exitcode is None:
                process.kill()
                process.join(_KILLED_S)

    def close(self) -> None:
        """End all nodes, the router last, and free its port."""
        if self._reserved is not None:
            self._reserved.close()
        self.stop([name for name in self._processes if name != ROUTER])
        self.stop([ROUTER])


def _is_stopped(pid: int | None) -> bool:
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    # The state is the first field after the name of the command, which is in brackets and may hold any character.
    return status.rpartition(")")[2].split()[0] == "T"
