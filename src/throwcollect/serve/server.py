"""The process that serves: its port, its file for programs, and how others find it."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import signal
import socket
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import uvicorn

from throwcollect.errors import ConfigError
from throwcollect.files import write_secret
from throwcollect.runs.records import state_directory
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.instances import Instances

FILE = "serve.json"
_MOST_FRAME = 10_000_000
_MOST_CLIENTS = 256


@dataclass(frozen=True)
class Address:
    """Where somebody serves, for programs of the same user.

    Attributes:
        url: Where, without a path.
        token: Lets its owner do everything.
        read_only_token: Lets its owner look.
        pid: Process id.
    """

    url: str
    token: str
    read_only_token: str
    pid: int

    def page(self, code: str) -> str:
        """The page, with a one-time code in the part of the address that is never sent."""
        return f"{self.url}/#code={code}"


@dataclass(frozen=True)
class Tls:
    """Files of a certificate and its key, in PEM."""

    certificate: Path
    key: Path


def serve(
    instances: Instances,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    tls: Tls | None = None,
    origins: frozenset[str] = frozenset(),
    names: frozenset[str] = frozenset(),
    tell: Callable[[Address, str], None],
) -> None:
    """Serve until the process is told to end.

    Args:
        instances: All runs, and what can be done with them.
        host: Address to listen at.
        port: Port to listen at; 0 for one that is free.
        tls: Certificate and key; None to speak in the clear.
        origins: Origins of pages that may connect, besides our own.
        names: Host names by which clients know this machine, besides the address.
        tell: Is told once where it serves, and a one-time code, when it can be reached.

    Raises:
        ConfigError: If the port is taken.
    """
    keys = Keys()
    with _listen(host, port) as listener:
        bound = listener.getsockname()[1]
        scheme = "https" if tls else "http"
        known = {"127.0.0.1", "localhost", "[::1]", host if ":" not in host else f"[{host}]", *names}
        hosts = frozenset(f"{name}:{bound}" for name in known) | (
            frozenset(known) if bound in (80, 443) else frozenset()
        )
        address = Address(f"{scheme}://{_reachable(host)}:{bound}", keys.full, keys.read_only, os.getpid())
        app = Access(make_app(instances, keys), keys, hosts, origins)
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            ws="websockets-sansio",
            ws_max_size=_MOST_FRAME,
            limit_concurrency=_MOST_CLIENTS,
            timeout_graceful_shutdown=2,
            ssl_certfile=None if tls is None else tls.certificate,
            ssl_keyfile=None if tls is None else tls.key,
            server_header=False,
        )
        logging.getLogger("throwcollect.serve").setLevel(logging.INFO)
        with _publish(address):
            tell(address, keys.new_code())
            server = uvicorn.Server(config)
            server.run(sockets=[listener])


@contextlib.contextmanager
def _listen(host: str, port: int) -> Iterator[socket.socket]:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    with contextlib.closing(listener):
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((host, port))
            listener.listen()
        except OSError as error:
            raise ConfigError(
                f"--host {host} --port {port}: nobody can be served there: {error.strerror}",
                hint="--port 0 takes one that is free; throwcollect view finds who serves already",
            ) from error
        yield listener


def _reachable(host: str) -> str:
    """The address at which this machine reaches a server that listens at one."""
    own = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104 - nothing is bound here
    return f"[{own}]" if ":" in own else own


@contextlib.contextmanager
def _publish(address: Address) -> Iterator[None]:
    path = state_directory() / FILE
    write_secret(path, json.dumps(asdict(address)).encode())
    try:
        yield
    finally:
        # A successor may have written its own by now.
        if (found := find_address()) is not None and found.pid == os.getpid():
            path.unlink(missing_ok=True)


def find_address() -> Address | None:
    """Where somebody of this user serves by now; None if nobody does."""
    try:
        address = Address(**json.loads((state_directory() / FILE).read_bytes()))
    except (OSError, ValueError, TypeError):
        return None
    try:
        os.kill(address.pid, 0)
    except OSError:
        return None
    return address


def end(address: Address) -> None:
    """Have a server end."""
    with contextlib.suppress(ProcessLookupError):
        os.kill(address.pid, signal.SIGTERM)
