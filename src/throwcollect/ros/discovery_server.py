"""A discovery server of Fast DDS, by which the nodes of a run on genuine rclpy find each other."""

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
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.interruption import die_with_parent
from throwcollect.ros.fast_dds import server_profile, write_temporarily
from throwcollect.ros.router_endpoint import split_address
from throwcollect.ros_installation import how_to_install

_PROGRAM = "fast-discovery-server"
_RUNNING = b"Server is running"
_STOP_S = 3.0
_LOOK_S = 0.02


@contextmanager
def discovery_server(endpoint: str) -> Iterator[None]:
    """Run a discovery server as a child process; the block begins when it listens, such as at ``udp/127.0.0.1:7447``.

    Meanwhile, this process accepts TCP connections at the same port, by which others find out that the server runs.
    """
    command = [_find_program(), "-i", "0", "-x", str(write_temporarily(server_profile(endpoint)))]
    with (
        _accept_connections(endpoint),
        # The output goes to a file and not to a pipe: nobody reads it later, and a full pipe would stop the server.
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
            yield
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def _accept_connections(endpoint: str) -> Iterator[None]:
    """Accept TCP connections and close them, because a UDP port does not show whether somebody listens."""
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
                time.sleep(_LOOK_S)

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
        time.sleep(_LOOK_S)


def _find_program() -> str:
    # If ROS is installed by pip, the program lies beside this Python, in a directory that PATH may not contain.
    beside_python = Path(sys.prefix, "bin", _PROGRAM)
    program = str(beside_python) if beside_python.is_file() else shutil.which(_PROGRAM)
    if program is None:
        raise ConfigError(
            f"there is no program {_PROGRAM}, by which nodes on Fast DDS find each other",
            hint=f"it comes with Fast DDS: {how_to_install()}; or set run.ros to embedded",
        )
    return program
