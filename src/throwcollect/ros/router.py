"""The router of a run: one of Zenoh, as ``ros2 run rmw_zenoh_cpp rmw_zenohd`` is, or a discovery server of Fast DDS.

``throwcollect router --listen tcp/127.0.0.1:7447`` runs one until it gets SIGTERM or SIGINT.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryFile
from typing import IO

import zenoh

from rclzenoh.session_config import OPEN, PROTECTED, describe, router_config
from throwcollect.errors import ConfigError, WorkerError
from throwcollect.own_process import Heartbeat, die_with_parent, stop_signals
from throwcollect.ros.connection import zenoh_errors
from throwcollect.ros.fast_dds import server_profile, write_temporarily
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router_endpoint import split_address
from throwcollect.ros_installation import HOW_TO_INSTALL
from throwcollect.run_key import RunKey

_PROGRAM = "fast-discovery-server"
_RUNNING = b"Server is running"
_STOP_S = 3.0
_SOON_S = 0.02
_LOOK_S = 0.5
_PORT_ATTEMPTS = 5


@contextmanager
def router(listen: str, key: RunKey | None = None) -> Iterator[str]:
    """Run a router in this process; yields the endpoint that nodes connect to. Port 0 takes a free one."""
    session, endpoint = _open(listen, key)
    try:
        yield endpoint
    finally:
        session.close()  # type: ignore[no-untyped-call]


def _open(listen: str, key: RunKey | None) -> tuple[zenoh.Session, str]:
    attempts_left = _PORT_ATTEMPTS if listen.endswith(":0") else 1
    while True:
        attempts_left -= 1
        endpoint = _choose_port(listen)
        with zenoh_errors():
            config = router_config(endpoint, key)
        if endpoint.startswith(PROTECTED) and key is None:
            raise ConfigError(
                f"the router cannot listen on {endpoint}: no key is named",
                expected="--key DIR, where a new key is made if there is none; or tcp/..., which lets every process in",
            )
        try:
            return zenoh.open(config), endpoint
        except zenoh.ZError as error:
            # Another process may have taken the free port meanwhile, so this tries again.
            if not attempts_left:
                raise ConfigError(
                    f"the router cannot listen on {endpoint}: {describe(error).rpartition(': ')[2]}",
                    expected="an address of this machine with a free port, such as tcp/127.0.0.1:0, which takes any",
                    hint="if another router listens there, use that one",
                ) from error


def _choose_port(listen: str) -> str:
    """Take a free port in the place of port 0 of an endpoint."""
    address, _, port = listen.rpartition(":")
    if port != "0":
        return listen
    host = address.partition("/")[2].strip("[]")
    try:
        family = socket.getaddrinfo(host, None)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.bind((host, 0))
            return f"{address}:{probe.getsockname()[1]}"
    except OSError as error:
        raise ConfigError(f"cannot listen on {address!r}: {error}", expected="such as tcp/127.0.0.1:0") from error


def serve(listen: str, key_directory: Path | None) -> None:
    """Run a router until SIGTERM, SIGINT or SIGHUP, after printing one line with its endpoint.

    Args:
        listen: Endpoint to listen on; port 0 takes a free one.
        key_directory: Directory of the key; at ``tls/...``, the router rejects processes without this key. If
            the directory holds no key, one is made. None for the key that the environment names.
    """
    if key_directory is None:
        key = RunKey.of_environment()
    elif not listen.startswith(PROTECTED):
        raise ConfigError(
            f"--key: {listen} lets any process in, whatever key there is", expected="tls/..., or no --key"
        )
    else:
        key = RunKey(key_directory.absolute())
        if not key.exists:
            key.create()
    # `sigwait` does not work, because libraries start threads when they are imported, which may get the signal instead.
    stop: SimpleQueue[int] = SimpleQueue()
    for number in stop_signals():
        signal.signal(number, lambda received, _frame: stop.put(received))
    # Nodes of an open run on Fast DDS find each other by multicast; the router of Zenoh only shows that the run lives.
    by_server = Middleware.of_process().is_fast_dds and not listen.startswith(OPEN)
    with discovery_server(listen) if by_server else router(listen, key) as endpoint:
        print(f"router listening on {endpoint}", flush=True)
        heartbeat = Heartbeat()
        # If a signal comes just before a wait, Python runs its handler only after the wait, so waits are short.
        while True:
            heartbeat.beat()
            with suppress(Empty):
                stop.get(timeout=_LOOK_S)
                return


@contextmanager
def discovery_server(listen: str) -> Iterator[str]:
    """Run a discovery server of Fast DDS as a child process; yields the endpoint that nodes use.

    Port 0 takes a free one. The block begins when the server listens. Meanwhile, this process accepts TCP connections
    at the same port, by which others find out that the server runs.
    """
    endpoint = _choose_port(listen)
    command = [_find_program(), "-i", "0", "-x", str(write_temporarily(server_profile(endpoint)))]
    with (
        _accept_connections(endpoint),
        # The output goes to a file and not to a pipe: it is never read, and a full pipe would stop the server.
        TemporaryFile() as output,
        subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            preexec_fn=partial(die_with_parent, os.getpid()),  # noqa: PLW1509 - it calls nothing that takes a lock
        ) as process,
    ):
        try:
            _wait_until_it_runs(process, output, endpoint)
            yield endpoint
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def _accept_connections(endpoint: str) -> Iterator[None]:
    """Accept TCP connections and close them, because a UDP port does not show whether a process listens."""
    try:
        server = socket.create_server(split_address(endpoint))
    except OSError as error:
        raise ConfigError(
            f"the discovery server cannot listen on {endpoint}: {error.strerror}",
            expected="an address of this machine with a free port, such as udp/127.0.0.1:0, which takes any",
        ) from error

    def accept() -> None:
        while server.fileno() != -1:
            try:
                server.accept()[0].close()
            except OSError:
                # The socket is being closed, or the process has too many open files at the moment.
                time.sleep(_SOON_S)

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield
    finally:
        # `close` alone would leave the thread in `accept`.
        server.shutdown(socket.SHUT_RDWR)
        server.close()


def _wait_until_it_runs(process: subprocess.Popen[bytes], output: IO[bytes], endpoint: str) -> None:
    while True:
        # The end is checked before the output is read, so that after the end, all of the output is read.
        has_ended = process.poll() is not None
        said = os.pread(output.fileno(), os.fstat(output.fileno()).st_size, 0)
        if _RUNNING in said:
            return
        if has_ended:
            evidence = said.decode(errors="replace").strip()
            raise WorkerError(f"the discovery server at {endpoint} has ended", evidence=evidence or None)
        time.sleep(_SOON_S)


def _find_program() -> str:
    # If ROS is installed by pip, the program lies next to this Python, in a directory that PATH may not contain.
    beside_python = Path(sys.prefix, "bin", _PROGRAM)
    program = str(beside_python) if beside_python.is_file() else shutil.which(_PROGRAM)
    if program is None:
        raise ConfigError(
            f"there is no program {_PROGRAM}, by which nodes on Fast DDS find each other",
            hint=f"it comes with Fast DDS: {HOW_TO_INSTALL}; or set run.ros to embedded",
        )
    return program
