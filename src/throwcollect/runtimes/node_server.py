"""A process that imports the libraries of nodes once, and forks all nodes.

Importing the libraries takes most of a second of processor time. A forked node has them at once, and shares their
memory with the other nodes. It is still a process of its own, which can be killed, stopped, bound to a core and
examined like any other.

`NodeServer` is the launcher's side. `serve` is the side of the process that forks; it returns in each forked node.
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
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, BinaryIO, NoReturn

from throwcollect.config import shape
from throwcollect.config.schema import Config
from throwcollect.errors import ThrowcollectError
from throwcollect.interruption import die_with_parent, leave_when_stopped, stop_signals
from throwcollect.own_process import make_command
from throwcollect.ros.middleware import Middleware
from throwcollect.runtimes.forked_process import ForkedProcess

_MESSAGE_BYTES = 1 << 16
_ANSWER_S = 60.0
"""Importing takes a second, and more on a busy machine; after this time something is wrong."""
_LOOK_S = 0.5
_LIBRARIES = (
    "throwcollect.cli.main",
    "throwcollect.ros.router",
    "throwcollect.sim.simulation_process",
    "throwcollect.coordinator.coordinator_process",
    "pinocchio",
    "pyarrow.parquet",
)


class ForkedNode:
    """A node that a `NodeServer` has forked, with the part of the interface of `subprocess.Popen` that hosts need.

    `returncode` is None until `poll` or `wait` has seen the end.
    """

    def __init__(self, server: NodeServer, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._server = server

    def poll(self) -> int | None:
        """How the node ended; None while it runs."""
        if self.returncode is None:
            self.returncode = self._server.take_end(self.pid)
        return self.returncode

    def send_signal(self, number: signal.Signals) -> None:
        """Send the node a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def wait(self, timeout_s: float) -> int | None:
        """Wait for the end of the node; None if it still runs after this time [s]."""
        deadline = time.monotonic() + timeout_s
        while self.poll() is None and (left := deadline - time.monotonic()) > 0:
            self.returncode = self._server.take_end(self.pid, patience_s=left)
        return self.returncode


class NodeServer:
    """Lets a process of its own fork nodes; `environment` is the environment of that process and so of all nodes.

    If that process dies, its nodes die with it, and a new process is started for the next node.
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
        """Start the process that forks, so that the first node waits less for imports.

        That process computes once what all nodes of this configuration need. With `fork`, it is forked off this
        process, and so need not repeat the imports that this process has made.
        """
        with contextlib.suppress(OSError), open(os.devnull, "wb") as nowhere:
            connection = self._launch(self._fork) if fork else self._connect(nowhere)
            connection.send(json.dumps({"configuration": config.model_dump(mode="json")}).encode())
            self._silent = True
            self._answer_s = min(_ANSWER_S, config.run.start_timeout_s)

    def start(
        self, arguments: Sequence[str], *, log: BinaryIO, core: int | None, environment: Mapping[str, str]
    ) -> ForkedNode:
        """Start a node: a `throwcollect` command with these arguments and these further environment variables.

        The node prints to `log`, and is bound to the processor core `core` unless that is None.
        """
        request = json.dumps({"arguments": list(arguments), "core": core, "environment": dict(environment)}).encode()
        if self._silent:
            self._silent = False
            with contextlib.suppress(OSError):
                return self._request(request, log)
            # The process that `begin` started had no log for an error. A new process writes the error into this log.
            self.close()
        return self._request(request, log)

    def take_end(self, pid: int, *, patience_s: float = 0.0) -> int | None:
        """Return how a node ended, like `subprocess.Popen.returncode`, and forget the node; None while it runs.

        If no node has ended, this waits for the end of any node, but no longer than `patience_s` [s].
        """
        self._read(patience_s)
        return self._ends.pop(pid, None)

    def close(self) -> None:
        """End the process, and with it all nodes that still run, by force."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def _request(self, request: bytes, log: BinaryIO) -> ForkedNode:
        """Let the process fork a node."""
        socket.send_fds(self._connect(log), [request], [log.fileno()])
        pid = self._await_pid()
        self._running.add(pid)
        return ForkedNode(self, pid)

    def _connect(self, log: BinaryIO) -> socket.socket:
        """Return the socket to the process; start the process if it does not run, with errors printed to `log`."""
        if self._socket is not None:
            return self._socket
        return self._launch(partial(self._start_program, log))

    def _launch(self, start: Callable[[socket.socket], subprocess.Popen[bytes] | ForkedProcess]) -> socket.socket:
        """Start the process with one end of a new connection, and return the other end."""
        # Sockets of this type keep messages apart, as datagram sockets do, but also tell when the other end is closed.
        here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # A copy of the other end that stayed open here would hide that the process has ended.
        with there:
            self._process = start(there)
        self._socket = here
        return here

    def _start_program(self, log: BinaryIO, connection: socket.socket) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [*make_command("throwcollect.runtimes.node_server"), str(connection.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=self._environment,
            pass_fds=[connection.fileno()],
            start_new_session=True,
            preexec_fn=partial(die_with_parent, os.getpid()),  # noqa: PLW1509 - it calls nothing that takes a lock
        )

    def _fork(self, connection: socket.socket) -> ForkedProcess:
        return ForkedProcess(partial(_run, connection), environment=self._environment, kept=connection.fileno())

    def _await_pid(self) -> int:
        """Wait for the process id of a node that was asked for."""
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
        """Read messages of the process, waiting for `timeout_s` [s] at most; keep ends of nodes for `take_end`."""
        messages: list[dict[str, int]] = []
        if self._process is not None:
            # Somebody may have stopped the process together with the nodes. It has to run to report ends of nodes.
            self._process.send_signal(signal.SIGCONT)
        while self._socket is not None and select.select([self._socket], [], [], timeout_s)[0]:
            try:
                packet = self._socket.recv(_MESSAGE_BYTES)
            except ConnectionError:
                packet = b""
            if not packet:
                # The process has ended, so the kernel kills its nodes.
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
    """Fork nodes until the launcher closes its end of the connection, which has to keep messages apart.

    Returns:
        In each node, the arguments of the node; in the process that forks, this function does not return.
    """
    # `select` goes on waiting after a signal (PEP 475). So each signal also writes a byte to `wake`, which ends that.
    awake, wake = socket.socketpair()
    for end in (awake, wake):
        end.setblocking(False)
    signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    # Python writes a signal to the wakeup descriptor only if the signal has a handler.
    signal.signal(signal.SIGCHLD, lambda *_: None)
    # The garbage collector would write to the memory pages of all objects, which nodes could then no longer share.
    gc.freeze()
    # Since 3.12, Python warns if a process with threads forks. The only other thread here is that of Arrow's allocator,
    # with which forking is safe.
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
        # A request for a node comes with a log file. Any other message is a configuration to prepare for.
        if not logs:
            _prepare_for(json.loads(packet)["configuration"])
            gc.freeze()
            continue
        # A signal may ask the node to stop before it runs. Python loses signals during a fork, so they are blocked.
        held = signal.pthread_sigmask(signal.SIG_BLOCK, stop_signals())
        if (pid := os.fork()) == 0:
            # SIGKILL gives the node no time to finish, but a coordinator could not finish without router and
            # simulations anyway.
            die_with_parent(server)
            for end in (connection, awake, wake):
                end.close()
            request = json.loads(packet)
            os.environ.update(request["environment"])
            _become_node(logs[0], request["core"])
            leave_when_stopped()
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
            return list(request["arguments"])
        signal.pthread_sigmask(signal.SIG_SETMASK, held)
        os.close(logs[0])
        _send(connection, started=pid)


def _report_ends(connection: socket.socket) -> None:
    """Tell the launcher of all nodes that have ended."""
    with contextlib.suppress(ChildProcessError):
        # One SIGCHLD may stand for several ended processes, because the kernel does not queue a second one.
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            _send(connection, ended=ended[0], code=os.waitstatus_to_exitcode(ended[1]))


def _send(connection: socket.socket, **message: int) -> None:
    # If the launcher has ended, its end of the connection is closed, which `serve` notices when it reads next.
    with contextlib.suppress(OSError):
        connection.send(json.dumps(message).encode())


def _become_node(log: int, core: int | None) -> None:
    """Give a forked process the signals, session, core and streams of a process that was started by itself."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()
    if core is not None:
        os.sched_setaffinity(0, {core})
    for stream in (1, 2):
        os.dup2(log, stream)
    os.close(log)


def main() -> None:
    """Serve the connection whose descriptor is the only argument of the command line."""
    _run(socket.socket(fileno=int(sys.argv[1])))


def _run(connection: socket.socket) -> None:
    """Serve a connection; in a forked process, run the node."""
    _set_title("throwcollect.runtimes.node_server", str(connection.fileno()))
    _import_libraries()
    arguments = serve(connection)
    _set_title("throwcollect", *arguments)
    sys.argv[1:] = arguments
    # If this process was forked off a command, the module is imported already, and `runpy` would warn about that.
    sys.modules.pop("throwcollect.__main__", None)
    try:
        runpy.run_module("throwcollect", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if Middleware.of_process().backend != "embedded" or not isinstance(end.code, int):
            raise
        _exit_at_once(end.code)


def _set_title(module: str, *arguments: str) -> None:
    """Let `ps` show the command of this process instead of the command of the process that forked it."""
    import setproctitle

    setproctitle.setproctitle(" ".join([sys.executable, "-m", module, *arguments]))


def _exit_at_once(code: int) -> NoReturn:
    """End this process without the usual end of the interpreter, which writes to all memory that nodes share.

    Nodes have closed their files and sessions before. If the user has given Zenoh shared memory, it leaves files of
    such a process in /dev/shm; the next process that ends as usual, which is the launcher, removes them. Nodes on
    genuine ROS 2 do not end in this way, because its libraries clean up after the end of the interpreter.
    """
    # `multiprocessing` ends its forked processes in the same way.
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def _import_libraries() -> None:
    """Import the libraries of nodes; if one is missing, the node that needs it reports the error."""
    for module in _LIBRARIES:
        with contextlib.suppress(ImportError, ThrowcollectError):
            importlib.import_module(module)
    shape.root()


def _prepare_for(values: Mapping[str, Any]) -> None:
    """Compute and cache what all nodes of a configuration need; if that fails, a node reports the error.

    This is the parsed text of the configuration, the digest of the build, the types and layouts of messages, a model of
    the robot and, if the physics engine allows it, the world. The task is only imported.
    """
    from throwcollect.config.document import compose
    from throwcollect.config.loader import dump_yaml
    from throwcollect.episode.channels import Channels
    from throwcollect.robots.description import full_description
    from throwcollect.robots.tool_motion import ToolMotion
    from throwcollect.sim.simulation_process import make_ahead
    from throwcollect.tasks.task import task_of
    from throwcollect.trial.conditions import build_of

    with contextlib.suppress(ImportError, ValueError, ThrowcollectError):
        config = Config.model_validate(values)
        task_of(config)
        build_of(config)
        compose(dump_yaml(config))
        Channels(config, full_description(config))
        ToolMotion(config)
        make_ahead(config)


if __name__ == "__main__":
    main()
