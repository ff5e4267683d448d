"""The process that serves: its port, its settings, and its log."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Literal

import uvicorn

from throwcollect.errors import ConfigError
from throwcollect.ros.router_endpoint import reach_from_here
from throwcollect.serve.access import Access, Keys
from throwcollect.serve.app import make_app
from throwcollect.serve.finding import Address, publish
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge.codec import LONGEST_FRAME

_PORT = 8080
"""Port to serve at if the user names none and it is free."""
WEBSOCKETS: Literal["websockets-sansio"] = "websockets-sansio"
"""This implementation of WebSockets waits for a client that reads slowly, and does not collect frames in memory."""
_END_S = 2.5
"""Time within which the process ends after a signal."""


def serve(
    instances: Instances,
    models: Path,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
    origins: frozenset[str] = frozenset(),
    names: frozenset[str] = frozenset(),
    keys: Keys,
    on_ready: Callable[[Address, str], None],
) -> None:
    """Serve until a signal asks the process to end.

    Args:
        instances: All runs, and what can be done with them.
        models: Directory of models.
        host: Address to listen at.
        port: Port to listen at, 0 for any free one; None for 8080, or any free one if 8080 is taken.
        certificate: File of a certificate in PEM; None to serve without TLS.
        key: File of its key in PEM.
        origins: Further origins of pages that may connect.
        names: Host names by which clients know this machine, besides the address.
        keys: The tokens.
        on_ready: Called once, when the server can be reached, with the server's address and a one-time code.
    """
    with _listen(host, port) as listener:
        bound = listener.getsockname()[1]
        scheme = "https" if certificate else "http"
        known = {"127.0.0.1", "localhost", "[::1]", _bracket(host), *names}
        hosts = frozenset(f"{name}:{bound}" for name in known)
        if bound in (80, 443):
            # Clients leave the default port of a scheme out of the header Host.
            hosts |= known
        url = f"{scheme}://{_bracket(reach_from_here(host))}:{bound}"
        pinned = None if certificate is None else str(certificate.absolute())
        address = Address(url, keys.full, keys.read_only, os.getpid(), pinned)
        app = Access(make_app(instances, models, keys), keys, hosts, origins)
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            ws=WEBSOCKETS,
            ws_max_size=LONGEST_FRAME,
            # Most clients are on this machine, where compression only costs time.
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
            # These headers are ignored, because any client could send them.
            proxy_headers=False,
            ssl_certfile=certificate,
            ssl_keyfile=key,
            server_header=False,
        )
        _load(config)
        _write_lines()
        with publish(address):
            on_ready(address, keys.new_code())
            # uvicorn raises the signal that ended it a second time. For a server, that is the usual end and no error.
            with contextlib.suppress(KeyboardInterrupt):
                _Server(config).run(sockets=[listener])


class _Server(uvicorn.Server):
    """A server that ends soon after a signal, whatever its threads are doing.

    Threads need not finish their work, because the next server finds on disk what is left to do.
    """

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if not self.should_exit:
            timer = threading.Timer(_END_S, os._exit, (0,))
            timer.daemon = True
            timer.start()
        super().handle_exit(sig, frame)


def _load(config: uvicorn.Config) -> None:
    """Load the configuration of uvicorn."""
    try:
        config.load()
    except OSError as error:
        raise ConfigError(
            f"--tls-cert {config.ssl_certfile} --tls-key {config.ssl_keyfile}: cannot be used: {error}",
            expected="a certificate and its key without a password, both in PEM",
        ) from error


def _write_lines() -> None:
    """Write a line for each request to standard error, which is the log of a server in the background."""
    lines = logging.StreamHandler()
    lines.setFormatter(logging.Formatter("%(asctime)s %(message)s"))
    logger = logging.getLogger("throwcollect.serve")
    logger.setLevel(logging.INFO)
    logger.addHandler(lines)


def _listen(host: str, port: int | None) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        try:
            return socket.create_server((host, _PORT if port is None else port), family=family)
        except OSError:
            if port is not None:
                raise
            return socket.create_server((host, 0), family=family)
    except OSError as error:
        raise ConfigError(
            f"--host {host} --port {_PORT if port is None else port}: cannot listen there: {error.strerror}",
            hint="--port 0 takes one that is free; throwcollect view finds who serves already",
        ) from error


def _bracket(host: str) -> str:
    """A host as it stands in URLs."""
    return f"[{host}]" if ":" in host else host
