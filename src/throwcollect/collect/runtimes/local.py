"""The runtime ``local``: nodes as processes of this machine, forked from one that has imported what nodes need.

Importing takes a second of a processor: without this, eight nodes on two cores would spend four seconds with it.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

import setproctitle

from throwcollect.collect.runtimes.node_logs import NodeLogs
from throwcollect.collect.runtimes.nodes import (
    ROUTER,
    NodeExit,
    NodeHost,
    NodeSpec,
    choose_protocol,
    describe_end,
    make_environment,
)
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.runtime import Runtime
from throwcollect.errors import WorkerError
from throwcollect.files import open_log
from throwcollect.own_process import die_with_parent, make_command
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import VARIABLE
from throwcollect.ros.router_endpoint import format_endpoint, reach_from_here, reserve_port
from throwcollect.side_by_side import launching

if TYPE_CHECKING:
    from throwcollect.config.schema import Config

_KILLED_S = 5.0
"""Time that a process has to end after SIGKILL."""


class LocalRuntime(Runtime):
    """Nodes as child processes of the launcher."""

    def describe(self, config: Config) -> str:
        """See `Runtime.describe`."""
        return "local processes"

    def host(self, record: RunRecord, config: Config, *, warn: Callable[[str], None]) -> LocalNodes:
        """Make the host of a run; see `Runtime.host`."""
        return LocalNodes(record, config)


class LocalNodes(NodeHost):
    """Runs nodes as processes, each with a log file of its own; see `nodes.NodeHost`.

    They live in sessions of their own, so that Ctrl-C reaches only the launcher. The kernel ends them when the launcher
    dies.

    Args:
        elsewhere: Endpoint of a router on another machine; None if the router is one of the nodes.
    """

    cleared = True

    def __init__(self, record: RunRecord, config: Config, *, elsewhere: str | None = None) -> None:
        self.record = record
        self.config = config
        self.data = str(record.directory)
        self.logs = NodeLogs(record.logs)
        self._reserved: socket.socket | None = None
        if elsewhere is not None:
            self.listen = self._endpoint = elsewhere
        else:
            self._reserved = reserve_port(config.run)
            host, port = self._reserved.getsockname()[:2]
            protocol = choose_protocol(config.run, record.middleware)
            self.listen = format_endpoint(protocol, host, port)
            self._endpoint = format_endpoint(protocol, reach_from_here(host), port)
        connection = Connection(self._endpoint, record.key, config.run.domain_id, record.middleware)
        self._environment = {**os.environ, **make_environment(connection)}
        self._processes: dict[str, BaseProcess] = {}

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
            self._processes[node.name] = _start_process(
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


FORESEEN = "THROWCOLLECT_FORESEEN"
"""Environment variable by which `fork_server` gets the configuration of simulations, in JSON."""


def begin_imports(*modules: str, foreseen: str = "") -> None:
    """Let a process begin to import what nodes need, and `modules`, unless it has begun; it ends with this process.

    What simulations of the configuration `foreseen`, in JSON, begin with is worked out there, once for all of them.
    """
    forkserver.set_forkserver_preload(["throwcollect.collect.runtimes.fork_server", *modules])
    with launching():
        # The kernel starts no process with an environment variable of 128 KiB.
        os.environ[FORESEEN] = foreseen[:100_000]
        forkserver.ensure_running()
        del os.environ[FORESEEN]


def _start_process(
    command: Sequence[str], environment: Mapping[str, str], log: Path, *, core: int | None
) -> BaseProcess:
    """Start a node in a session of its own, which Ctrl-C does not reach; the kernel ends it with this process.

    Args:
        command: The command line of the node.
        environment: All environment variables of the node.
        log: File to which its output is appended.
        core: Processor core to which it is bound; None for any.
    """
    begin_imports()
    run = (tuple(command), dict(environment), log.absolute(), Path.cwd(), core)
    process = multiprocessing.get_context("forkserver").Process(target=_run, args=run)
    with launching():
        process.start()
    return process


def _run(command: Sequence[str], environment: Mapping[str, str], log: Path, cwd: Path, core: int | None) -> None:
    """Become a node, as if this process had been started by its command line."""
    # Otherwise this process would keep the server alive, and the server, on whose end it waits, this process.
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    die_with_parent(os.getppid())
    launcher = multiprocessing.parent_process()
    if launcher is None or not launcher.is_alive():
        os._exit(1)
    os.setsid()
    output = open_log(log)
    for stream in (1, 2):
        os.dup2(output, stream)
    os.close(output)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    if core is not None:
        os.sched_setaffinity(0, {core})
    os.chdir(cwd)
    ours = make_command()
    if command[: len(ours)] != tuple(ours) or environment[VARIABLE] != "embedded":
        # The server has imported our libraries with the embedded backend, and a process has one.
        os.execve(command[0], list(command), environment)  # noqa: S606 - no shell is wanted
    # This works only before the environment is replaced.
    setproctitle.setproctitle(" ".join(command))
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[1:] = command[len(ours) :]
    runpy.run_module("throwcollect", run_name="__main__", alter_sys=True)
