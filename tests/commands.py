"""Runs commands as users do, each in a process of its own, without importing their libraries once more for each.

Importing takes most of a second of a processor, and tests run hundreds of commands. So `CommandServer` has one process
import them and compute what a process computes only once, and forks that one for each command. What is forked has its
own command line, streams, directory and environment, handles signals and ends as a command that was started by itself,
and may be killed at any moment.

Tests of the start itself, and those whose environment decides what is imported, start commands by themselves.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import gc
import importlib
import json
import multiprocessing.util
import os
import pkgutil
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from multiprocessing import forkserver
from pathlib import Path
from typing import IO, NoReturn, Self

import setproctitle

import throwcollect
from tests.restrictions import FREE, Restrictions
from throwcollect import side_by_side
from throwcollect.build import build_digest
from throwcollect.config import shape
from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.own_process import SERIAL_LIBRARIES, die_with_parent
from throwcollect.robots.description import full_description
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.feasibility import Feasibility

_spawn = multiprocessing.util.spawnv_passfds
_MESSAGE_BYTES = 1 << 17
_ANSWER_S = 60.0
"""Most time for an answer of the server: importing takes two seconds, and longer on a busy machine."""
_LOOK_S = 0.2
_DECIDES_IMPORTS = ("PYTHON", "LD_", "THROWCOLLECT_ROS", "RMW_", "ROS_", "OPENBLAS_", "OMP_")
"""Prefixes of variables that have an effect only if a process starts with them."""
_READ_LATER = ("ROS_DOMAIN_ID",)
"""Exceptions of these prefixes: each context reads these variables when it is made."""
_IMPORTED = ("pinocchio", "pybullet", "pyarrow.parquet")
_RUN_WHEN_IMPORTED = ("throwcollect.__main__", "throwcollect.collect.runtimes.fork_server")


def command(*arguments: str | Path) -> list[str]:
    """The words of a command that starts by itself."""
    return [sys.executable, "-m", "throwcollect", *map(str, arguments)]


class ForkedCommand:
    """A command that a `CommandServer` has forked; it is used like a `subprocess.Popen` whose streams are text.

    Attributes:
        pid: Its process id.
        returncode: How it ended; None as long as nobody has asked after its end.
        stdout: What it prints; None where that was led elsewhere.
        stderr: What it complains about; None where that was led elsewhere.
    """

    def __init__(self, server: CommandServer, pid: int, stdout: IO[str] | None, stderr: IO[str] | None) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdout = stdout
        self.stderr = stderr
        self._server = server

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for stream in (self.stdout, self.stderr):
            if stream is not None:
                stream.close()
        self.wait()

    def poll(self) -> int | None:
        """How it ended; None while it runs."""
        if self.returncode is None:
            self.returncode = self._server.take_end(self.pid, 0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end.

        Raises:
            subprocess.TimeoutExpired: If it still runs after that time [s].
        """
        deadline = time.monotonic() + (timeout if timeout is not None else 1e9)
        while self.returncode is None:
            if (left := deadline - time.monotonic()) < 0:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
            self.returncode = self._server.take_end(self.pid, min(left, _LOOK_S))
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Read what it says until it ends.

        Raises:
            subprocess.TimeoutExpired: If it still runs after that time [s].
        """
        said = {"stdout": "", "stderr": ""}

        def read(name: str, stream: IO[str]) -> None:
            with stream:
                said[name] = stream.read()

        streams = {"stdout": self.stdout, "stderr": self.stderr}
        readers = [
            threading.Thread(target=read, args=(name, stream), daemon=True)
            for name, stream in streams.items()
            if stream is not None and not stream.closed
        ]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
        return said["stdout"], said["stderr"]

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it by force."""
        self.send_signal(signal.SIGKILL)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)


class CommandServer:
    """Starts commands that have their libraries at once; commands do not end with it."""

    def __init__(self) -> None:
        self._imported_with = dict(os.environ)
        self._process: subprocess.Popen[bytes] | None = None
        self._socket, self._its_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._lock = threading.Lock()
        self._started: list[int] = []
        self._ends: dict[int, int] = {}

    def can_start(self, environment: Mapping[str, str]) -> bool:
        """Whether a command with these variables would import what this one has imported."""
        return _what_decides_imports(environment) == _what_decides_imports(self._imported_with)

    def start(
        self,
        arguments: Sequence[str],
        *,
        environment: Mapping[str, str],
        cwd: Path | None = None,
        stdout: int = subprocess.PIPE,
        stderr: int | None = subprocess.PIPE,
        restrictions: Restrictions = FREE,
    ) -> ForkedCommand:
        """Start a command; streams are led as `subprocess.Popen` leads them, and nobody types anything."""
        with contextlib.ExitStack() as opened:
            nowhere = opened.enter_context(open(os.devnull, "r+b")).fileno()
            heard: list[IO[str] | None] = []
            given = [nowhere]
            for inherited, stream in enumerate((stdout, stderr), start=1):
                heard.append(None)
                if stream == subprocess.PIPE:
                    reading, writing = os.pipe()
                    opened.callback(os.close, writing)
                    heard[-1] = os.fdopen(reading, encoding="utf-8")
                    given.append(writing)
                elif stream is None:
                    given.append(inherited)
                else:
                    given.append({subprocess.DEVNULL: nowhere, subprocess.STDOUT: given[-1]}.get(stream, stream))
            request = {
                "arguments": list(arguments),
                "environment": dict(environment),
                "cwd": str(cwd or Path.cwd()),
                "restrictions": asdict(restrictions),
            }
            with self._lock:
                if self._process is None:
                    self._process = self._import()
                socket.send_fds(self._socket, [json.dumps(request).encode()], given)
                while not self._started:
                    self._read(_ANSWER_S)
                return ForkedCommand(self, self._started.pop(), *heard)

    def take_end(self, pid: int, timeout_s: float) -> int | None:
        """How a command ended, as `subprocess.Popen.returncode` says it; None if it runs on for some time [s]."""
        with self._lock:
            if pid not in self._ends:
                self._read(timeout_s)
            return self._ends.pop(pid, None)

    def close(self) -> None:
        """End it; commands that it has started live on."""
        self._socket.close()
        self._its_socket.close()
        if self._process is not None:
            self._process.wait()

    def _import(self) -> subprocess.Popen[bytes]:
        """The process that imports."""
        with self._its_socket:
            return subprocess.Popen(
                [sys.executable, "-m", "tests.commands", str(self._its_socket.fileno()), str(os.getpid())],
                pass_fds=[self._its_socket.fileno()],
                env={**SERIAL_LIBRARIES, **self._imported_with},
                cwd=Path(__file__).parents[1],
                start_new_session=True,
            )

    def _read(self, timeout_s: float) -> None:
        """Take in what the server says, which it is given some time [s] for."""
        while select.select([self._socket], [], [], timeout_s)[0]:
            packet = self._socket.recv(_MESSAGE_BYTES)
            assert packet, "the process that commands are forked from has ended"
            message = json.loads(packet)
            if (ended := message.get("ended")) is not None:
                self._ends[ended] = message["code"]
            else:
                self._started.append(message["started"])
            timeout_s = 0.0


Command = subprocess.Popen[str] | ForkedCommand
_servers: list[CommandServer] = []


@contextlib.contextmanager
def command_server() -> Iterator[None]:
    """Have `start_command` fork commands off a process that imports what they need with the first of them."""
    _servers.append(CommandServer())
    yield
    _servers.pop().close()


def start_command(
    *arguments: str | Path,
    cwd: Path | None = None,
    stdout: int = subprocess.PIPE,
    stderr: int | None = subprocess.PIPE,
    restrictions: Restrictions = FREE,
    **environment: str,
) -> Command:
    """Start a command whose output is text, with further environment variables."""
    whole = {**os.environ, **environment}
    if _servers and _servers[-1].can_start(whole):
        words = [str(each) for each in arguments]
        return _servers[-1].start(
            words, environment=whole, cwd=cwd, stdout=stdout, stderr=stderr, restrictions=restrictions
        )
    return subprocess.Popen(
        command(*arguments),
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=stderr,
        env=whole,
        text=True,
        # None, if possible: Python code between fork and exec may wait for ever for a lock of another thread.
        preexec_fn=None if restrictions == FREE else restrictions.impose,  # noqa: PLW1509
    )


def _what_decides_imports(environment: Mapping[str, str]) -> dict[str, str]:
    return {
        name: value
        for name, value in environment.items()
        if name.startswith(_DECIDES_IMPORTS) and name not in _READ_LATER
    }


def _import_libraries() -> None:
    """Import all modules of ours, and with them what they import."""
    for name in _IMPORTED:
        importlib.import_module(name)
    for each in pkgutil.walk_packages(throwcollect.__path__, "throwcollect.", onerror=lambda _: None):
        if each.name not in _RUN_WHEN_IMPORTED:
            # A module whose extra is not installed is not needed by the commands of these tests.
            with contextlib.suppress(ImportError):
                importlib.import_module(each.name)


def _compute_what_all_need() -> None:
    """Compute what a process keeps once it has it: the shape of a configuration, models of the robot, digests.

    That takes the processes of a small collection a quarter of its time. Commands that have nothing of it are those
    that tests start by themselves.
    """
    config = Config(name="first")
    shape.root()
    for engine in ("bullet", "ballistic"):
        build_digest(engine)
    Channels(config, full_description(config))
    ToolMotion(config)
    Feasibility(config)


def _serve(connection: socket.socket) -> list[str]:
    """Fork commands until the tests close their end; comes back in each command, with its arguments."""
    awake, wake = socket.socketpair()
    for each in (awake, wake):
        each.setblocking(False)
    signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    while True:
        ready, _, _ = select.select([connection, awake], [], [])
        if awake in ready:
            awake.recv(_MESSAGE_BYTES)
            _report_ends(connection)
        if connection not in ready:
            continue
        packet, streams, _, _ = socket.recv_fds(connection, _MESSAGE_BYTES, 3)
        if not packet:
            os._exit(0)
        if (pid := os.fork()) == 0:
            for each in (connection, awake, wake):
                each.close()
            return _become_command(json.loads(packet), streams)
        for stream in streams:
            os.close(stream)
        connection.send(json.dumps({"started": pid}).encode())


def _report_ends(connection: socket.socket) -> None:
    """Tell the tests of all commands that have ended."""
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            code = os.waitstatus_to_exitcode(ended[1])
            connection.send(json.dumps({"ended": ended[0], "code": code}).encode())


def _become_command(request: dict[str, object], streams: Sequence[int]) -> list[str]:
    """What a forked process does before it is a command like one that was started by itself."""
    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    arguments, environment, restrictions = (request[name] for name in ("arguments", "environment", "restrictions"))
    assert isinstance(arguments, list)
    assert isinstance(environment, dict)
    assert isinstance(restrictions, dict)
    Restrictions(**restrictions).impose()
    # `setproctitle` works only before the environment is replaced.
    setproctitle.setproctitle(" ".join(command(*arguments)))
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(str(request["cwd"]))
    return arguments


def _fork_server_of_nodes(path: str, arguments: Sequence[str], passed: Sequence[int]) -> int:
    """Fork the process that nodes are forked from, too, in the place of `multiprocessing.util.spawnv_passfds`.

    It has then imported and computed what takes it a second of a processor. Libraries that have started threads would
    miss them in a fork.
    """
    if "multiprocessing.forkserver" not in arguments[-1] or len(os.listdir("/proc/self/task")) > 1:
        return _spawn(path, arguments, passed)
    if pid := os.fork():
        return pid
    setproctitle.setproctitle("forkserver")
    for stream in map(int, os.listdir("/proc/self/fd")):
        if stream > 2 and stream not in passed:
            with contextlib.suppress(OSError):
                os.close(stream)
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # The launcher holds the locks of these two at the moment.
    forkserver._forkserver.__init__()  # type: ignore[misc]
    side_by_side._launch = threading.Lock()
    with contextlib.suppress(SystemExit):
        exec(arguments[-1], {})  # noqa: S102 - what `python -c` would do
    os._exit(0)


def _leave(code: int) -> NoReturn:
    """End without taking the interpreter apart, which takes a third of a second with all that is imported here.

    Libraries tidy up behind Python: that is what ending by `os._exit` would leave out.
    """
    # This closes unreferenced Zenoh sessions, which removes their files in /dev/shm.
    gc.collect()
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    ctypes.CDLL(None).exit(code)
    raise AssertionError("exit(3) does not come back")


def main() -> None:
    """Serve the connection whose file descriptor the command line names, and be a command where one is forked."""
    die_with_parent(int(sys.argv[2]))
    connection = socket.socket(fileno=int(sys.argv[1]))
    _import_libraries()
    _compute_what_all_need()
    # The garbage collector does not write to frozen objects, so forked processes share their memory.
    gc.collect()
    gc.freeze()
    arguments = _serve(connection)
    sys.argv[1:] = arguments
    multiprocessing.util.spawnv_passfds = _fork_server_of_nodes
    code = 1
    try:
        runpy.run_module("throwcollect", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if isinstance(end.code, int):
            code = end.code
    _leave(code)


if __name__ == "__main__":
    main()
