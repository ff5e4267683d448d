"""The process that serves: its port, its file for programs, and how others find it."""

from __future__ import annotations

import contextlib
import logging
import logging.handlers
import os
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from types import FrameType
from typing import Literal

import uvicorn

from throwcollect.errors import ConfigError
from throwcollect.files import open_log
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.finding import Address, log_path, publish
from throwcollect.serve.instances import Instances
from throwcollect.serve.models import Models

PORT = 8080
"""Where to serve if nobody says otherwise, and it is free."""
WEBSOCKETS: Literal["websockets-sansio"] = "websockets-sansio"
"""The implementation of WebSockets; it waits for clients that read slowly, and keeps nothing for them meanwhile."""
_MOST_FRAME = 10_000_000
_MOST_CLIENTS = 256
_LOG_BYTES = 1_000_000
_END_S = 2.5
"""Time in which it ends when it is told to."""


@dataclass(frozen=True)
class Tls:
    """Files of a certificate and its key, in PEM."""

    certificate: Path
    key: Path


def serve(
    instances: Instances,
    models: Models,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    tls: Tls | None = None,
    origins: frozenset[str] = frozenset(),
    names: frozenset[str] = frozenset(),
    tell: Callable[[Address, str], None],
) -> None:
    """Serve until the process is told to end.

    Args:
        instances: All runs, and what can be done with them.
        models: All models.
        host: Address to listen at.
        port: Port to listen at, 0 for any that is free; None for 8080, or any that is free if that is not.
        tls: Certificate and key; None to speak in the clear.
        origins: Origins of pages that may connect, besides our own.
        names: Host names by which clients know this machine, besides the address.
        tell: Is told once where it serves, and a one-time code, when it can be reached.

    Raises:
        ConfigError: If the port is taken, or the certificate or its key cannot be used.
    """
    keys = Keys()
    with _listen(host, PORT if port is None else port, otherwise_any=port is None) as listener:
        bound = listener.getsockname()[1]
        scheme = "https" if tls else "http"
        known = {"127.0.0.1", "localhost", "[::1]", host if ":" not in host else f"[{host}]", *names}
        hosts = frozenset(f"{name}:{bound}" for name in known) | (
            frozenset(known) if bound in (80, 443) else frozenset()
        )
        url = f"{scheme}://{_reachable(host)}:{bound}"
        certificate = None if tls is None else str(tls.certificate.absolute())
        address = Address(url, keys.full, keys.read_only, os.getpid(), certificate)
        app = Access(make_app(instances, models, keys), keys, hosts, origins)
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            ws=WEBSOCKETS,
            ws_max_size=_MOST_FRAME,
            # On this machine it would cost time and spare nothing.
            ws_per_message_deflate=False,
            limit_concurrency=_MOST_CLIENTS,
            timeout_graceful_shutdown=1,
            # Who asks, and how, is seen from the connection alone.
            proxy_headers=False,
            ssl_certfile=None if tls is None else tls.certificate,
            ssl_keyfile=None if tls is None else tls.key,
            server_header=False,
        )
        _load(config)
        _write_lines()
        with publish(address):
            tell(address, keys.new_code())
            # The signal that ends it is raised once more afterwards; it is how a server ends, and no error.
            with contextlib.suppress(KeyboardInterrupt):
                _Server(config).run(sockets=[listener])


class _Server(uvicorn.Server):
    """A server that ends soon after it is told to, whatever still goes on in its threads.

    Nothing there has to be finished: whoever serves next finds out what is left to be done.
    """

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if not self.should_exit:
            timer = threading.Timer(_END_S, os._exit, (0,))
            timer.daemon = True
            timer.start()
        super().handle_exit(sig, frame)


def _load(config: uvicorn.Config) -> None:
    """Read what the server needs besides.

    Raises:
        ConfigError: If its certificate or key cannot be used.
    """
    try:
        config.load()
    except OSError as error:
        raise ConfigError(
            f"--tls-cert {config.ssl_certfile} --tls-key {config.ssl_keyfile}: cannot be used: {error}",
            expected="a certificate and its key without a password, both in PEM",
        ) from error


class _CutLog(logging.handlers.RotatingFileHandler):
    """The log of a server that was started in the background, which has at most two files of 1 MB.

    All else that is printed goes there, too.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, maxBytes=_LOG_BYTES, backupCount=1)

    def _open(self) -> TextIOWrapper:
        log = os.fdopen(open_log(Path(self.baseFilename)), "a")
        os.dup2(log.fileno(), sys.stderr.fileno())
        return log


def _write_lines() -> None:
    """Have a line written for each request."""
    lines: logging.Handler = logging.StreamHandler()
    # Where there is no such log, or no standard error, it is none either.
    with contextlib.suppress(OSError, ValueError):
        if os.path.samestat(os.fstat(sys.stderr.fileno()), log_path().stat()):
            lines = _CutLog(log_path())
    lines.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    logger = logging.getLogger("throwcollect.serve")
    logger.setLevel(logging.INFO)
    logger.addHandler(lines)


@contextlib.contextmanager
def _listen(host: str, port: int, *, otherwise_any: bool) -> Iterator[socket.socket]:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    with contextlib.closing(listener):
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            try:
                listener.bind((host, port))
            except OSError:
                if not otherwise_any:
                    raise
                listener.bind((host, 0))
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
