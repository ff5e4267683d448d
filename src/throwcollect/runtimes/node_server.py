"""A process that has imported what nodes need, and forks one for each that is asked for.

A node that is started by itself takes most of a second of a processor until its libraries are imported; one that is
forked has them at once, and shares their memory with all others. It is a process of its own all the same, which can be
killed, stopped, bound to a core and looked at like any other.

`NodeServer` is the side of the launcher. `serve` is the other one; it comes back in each node, as that.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, BinaryIO, NoReturn

from throwcollect.config import shape
from throwcollect.config.schema import Config
from throwcollect.errors import ThrowcollectError
from throwcollect.interruption import die_with_parent
from throwcollect.members import load_member
from throwcollect.ros.middleware import Middleware
from throwcollect.runtimes.forked_process import ForkedProcess

_MESSAGE_BYTES = 1 << 16
_ANSWER_S = 60.0
"""Importing takes a second, on machines that do a lot else some more."""
_LOOK_S = 0.5
_NO_VARIABLES: Mapping[str, str] = MappingProxyType({})
_LIBRARIES = (
    "throwcollect.cli.main",
    "throwcollect.ros.router",
    "throwcollect.sim.main",
    "throwcollect.coordinator.main",
    "pinocchio",
    "pyarrow.parquet",
)


class ForkedNode:
    """A node that a `NodeServer` has forked; of `subprocess.Popen`, it has what a launcher needs.

    Attributes:
        pid: Its process id.
        returncode: As that of `subprocess.Popen`; None as long as nobody has asked after its end.
    """

    def __init__(self, server: NodeServer, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._server = server

    def poll(self) -> int | None:
        """How it ended; None while it runs."""
        if self.returncode is None:
            self.returncode = self._server.take_end(self.pid)
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def wait(self, timeout_s: float) -> int | None:
        """Wait for its end, and say how it ended; None if it still runs after that time [s]."""
        deadline = time.monotonic() + timeout_s
        while self.poll() is None and (left := deadline - time.monotonic()) > 0:
            self._server.await_news(left)
        return self.returncode


class NodeServer:
    """Starts nodes that are there at once; if it dies, its nodes die with it, and the next node has a new one.

    Args:
        environment: Environment variables that hold while libraries are imported, and for all nodes.
    """

    def __init__(self, environment: Mapping[str, str]) -> None:
        self._environment = dict(environment)
        self._process: subprocess.Popen[bytes] | ForkedProcess | None = None
        self._socket: socket.socket | None = None
        self._silent = False
        self._answer_s = _ANSWER_S
        self._running: set[int] = set()
        self._ends: dict[int, int] = {}

    def begin(self, config: Config, *, fork: bool = False) -> None:
        """Have libraries imported from now on, so that the first node does not wait for all of that.

        Args:
            config: Configuration of the nodes that will be started; what all of them make of it is made once.
            fork: Whether this process is forked for that, and what it has imported is not imported once more.
        """
        with contextlib.suppress(OSError), open(os.devnull, "wb") as nowhere:
            connection = self._fork() if fork else self._connect(nowhere)
            connection.send(json.dumps({"configuration": config.model_dump(mode="json")}).encode())
            self._silent = True
            self._answer_s = min(_ANSWER_S, config.run.start_timeout_s)

    def start(
        self,
        arguments: Sequence[str],
        *,
        log: BinaryIO,
        core: int | None,
        environment: Mapping[str, str] = _NO_VARIABLES,
    ) -> ForkedNode:
        """Start a node.

        Args:
            arguments: Arguments of the `throwcollect` command.
            log: Where it prints to.
            core: Processor core that it is bound to; None for any.
            environment: Further environment variables.

        Raises:
            OSError: If no node can be had.
        """
        request = json.dumps({"arguments": list(arguments), "core": core, "environment": dict(environment)}).encode()
        if self._silent:
            self._silent = False
            with contextlib.suppress(OSError):
                return self._request(request, log)
            # Nobody has heard why; the next one has a log for that.
            self.close()
        return self._request(request, log)

    def take_end(self, pid: int) -> int | None:
        """How a node ended, as `subprocess.Popen.returncode` says it; None while it runs. It is forgotten then."""
        self._read(0.0)
        return self._ends.pop(pid, None)

    def await_news(self, timeout_s: float) -> None:
        """Wait until a node ends, but no longer than some time [s]."""
        self._read(timeout_s)

    def close(self) -> None:
        """End it, and with it all nodes that still run, by force."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def _request(self, request: bytes, log: BinaryIO) -> ForkedNode:
        """The node that the server starts for a request.

        Raises:
            OSError: If it starts none.
        """
        socket.send_fds(self._connect(log), [request], [log.fileno()])
        pid = self._await_pid()
        self._running.add(pid)
        return ForkedNode(self, pid)

    def _connect(self, log: BinaryIO) -> socket.socket:
        """The socket to the server, which is started if none runs."""
        if self._socket is not None:
            return self._socket
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "throwcollect.runtimes.node_server", str(there.fileno())],
                stdin=subprocess.DEVNULL,
                # What it says when it cannot work belongs to the node that it was started for.
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment,
                pass_fds=[there.fileno()],
                start_new_session=True,
                preexec_fn=partial(die_with_parent, os.getpid()),  # noqa: PLW1509 - it calls nothing that takes a lock
            )
        self._socket = here
        return here

    def _fork(self) -> socket.socket:
        """The socket to a server that is forked off this process.

        Raises:
            OSError: If there can be none.
        """
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with there:
            work = partial(_run, there)
            self._process = ForkedProcess(work, environment=self._environment, kept=there.fileno())
        self._socket = here
        return here

    def _await_pid(self) -> int:
        """The answer to a request to start.

        Raises:
            OSError: If none comes.
        """
        deadline = time.monotonic() + self._answer_s
        while time.monotonic() < deadline:
            for message in self._read(_LOOK_S):
                if (pid := message.get("started")) is not None:
                    return int(pid)
            if self._socket is None:
                raise OSError("the process that nodes are forked from has ended")
        self.close()
        raise OSError(f"the process that nodes are forked from has not answered for {self._answer_s:g} s")

    def _read(self, timeout_s: float) -> list[dict[str, int]]:
        """Take in what the server says, which it is given some time [s] for; ends are kept until they are asked for."""
        messages: list[dict[str, int]] = []
        if self._process is not None:
            # Nodes may be stopped, to look at them. This process must not be: nobody would hear of their ends.
            self._process.send_signal(signal.SIGCONT)
        while self._socket is not None and select.select([self._socket], [], [], timeout_s)[0]:
            try:
                packet = self._socket.recv(_MESSAGE_BYTES)
            except ConnectionError:
                packet = b""
            if not packet:
                # The kernel ends its nodes by force.
                self.close()
                self._ends |= dict.fromkeys(self._running, -signal.SIGKILL)
                self._running.clear()
                break
            message = json.loads(packet)
            messages.append(message)
            if (ended := message.get("ended")) is not None:
                self._running.discard(ended)
                self._ends[ended] = message["code"]
            timeout_s = 0.0
        return messages


def serve(connection: socket.socket) -> list[str]:
    """Fork nodes until the launcher closes its end of the connection.

    Args:
        connection: A connection that keeps messages apart.

    Returns:
        In each node, the arguments that it was asked for with; in the server itself it does not return.
    """
    awake, wake = socket.socketpair()
    for each in (awake, wake):
        each.setblocking(False)
    signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    # Without a handler of Python's, the signal would not be written there.
    signal.signal(signal.SIGCHLD, lambda *_: None)
    # Pages that the garbage collector writes to could not be shared.
    gc.freeze()
    # The one other thread is that of Arrow's allocator, which knows of forks. From 3.12 on, Python warns of any.
    warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
    server = os.getpid()
    while True:
        ready, _, _ = select.select([connection, awake], [], [])
        if awake in ready:
            awake.recv(_MESSAGE_BYTES)
            _report_ends(connection)
        if connection not in ready:
            continue
        packet, logs, _, _ = socket.recv_fds(connection, _MESSAGE_BYTES, 1)
        if not packet:
            sys.exit()
        if not logs:
            _prepare_for(json.loads(packet)["configuration"])
            gc.freeze()
            continue
        if (pid := os.fork()) == 0:
            # By force: without router and simulations there is nothing that a coordinator could wait for.
            die_with_parent(server)
            for each in (connection, awake, wake):
                each.close()
            request = json.loads(packet)
            os.environ.update(request["environment"])
            _become_node(logs[0], request["core"])
            return list(request["arguments"])
        os.close(logs[0])
        _send(connection, started=pid)


def _report_ends(connection: socket.socket) -> None:
    """Tell the launcher of all nodes that have ended."""
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            _send(connection, ended=ended[0], code=os.waitstatus_to_exitcode(ended[1]))


def _send(connection: socket.socket, **message: int) -> None:
    # A launcher that is gone has closed its end, which is seen at the next request.
    with contextlib.suppress(OSError):
        connection.send(json.dumps(message).encode())


def _become_node(log: int, core: int | None) -> None:
    """What a forked process does before it is a node like one that was started by itself."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    if core is not None:
        os.sched_setaffinity(0, {core})
    for stream in (1, 2):
        os.dup2(log, stream)
    os.close(log)


def main() -> None:
    """Serve the connection whose file descriptor the command line names."""
    _run(socket.socket(fileno=int(sys.argv[1])))


def _run(connection: socket.socket) -> None:
    """Serve a connection, and be a node where one is forked."""
    _show("throwcollect.runtimes.node_server", str(connection.fileno()))
    _import_libraries()
    arguments = serve(connection)
    _show("throwcollect", *arguments)
    sys.argv[1:] = arguments
    # A command that was forked for this has it, and would not import it once more.
    sys.modules.pop("throwcollect.__main__", None)
    try:
        runpy.run_module("throwcollect", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if Middleware.of_process().backend != "embedded" or not isinstance(end.code, int):
            raise
        _leave(end.code)


def _show(module: str, *arguments: str) -> None:
    """Have `ps` show what this process does, and not what the one was started for that it was forked off."""
    import setproctitle

    setproctitle.setproctitle(" ".join([sys.executable, "-m", module, *arguments]))


def _leave(code: int) -> NoReturn:
    """End this process without taking the interpreter apart: it writes to all memory that is shared with other nodes.

    Nodes have closed their files and sessions before. What Zenoh leaves of such a process in /dev/shm is removed by the
    next one that ends as usual, which is the launcher. Libraries of genuine ROS 2 tidy up behind Python, so theirs end
    in the usual way.
    """
    # As `multiprocessing` ends what it forks.
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _import_libraries() -> None:
    """Import what nodes import, and make what all of them need; what is missing is told by the node that needs it."""
    for module in _LIBRARIES:
        with contextlib.suppress(ImportError, ThrowcollectError):
            importlib.import_module(module)
    shape.root()


def _prepare_for(values: Mapping[str, Any]) -> None:
    """Make what all nodes of a configuration make, and keep; what is wrong is told by the node that needs it.

    That are the digest of what computes, types and layouts of messages, and a model of the robot; the task and the
    physics engine are only imported.
    """
    from throwcollect.build import build_digest
    from throwcollect.episode.channels import Channels
    from throwcollect.robots.description import full_description
    from throwcollect.robots.tool_motion import ToolMotion
    from throwcollect.tasks.task import task_of

    with contextlib.suppress(ImportError, ValueError, ThrowcollectError):
        config = Config.model_validate(values)
        load_member("engines", config.sim.engine)
        task_of(config)
        build_digest(config.sim.engine)
        Channels(config, full_description(config))
        ToolMotion(config)


if __name__ == "__main__":
    main()
