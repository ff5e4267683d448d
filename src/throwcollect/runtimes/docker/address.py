"""The address of the Docker engine, and a check of its socket that spares the long import of the client."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from throwcollect.errors import WorkerError

_DEFAULT_HOST = "unix:///var/run/docker.sock"


def engine_address() -> str:
    """Address of the engine: ``DOCKER_HOST``, or the usual socket."""
    return os.environ.get("DOCKER_HOST") or _DEFAULT_HOST


def has_socket() -> bool:
    """Whether the engine's socket exists; true also for an engine that has no socket in the file system."""
    path = engine_address().removeprefix("unix://")
    return not path.startswith("/") or Path(path).exists()


def check_socket() -> None:
    """Raise the error of `docker_engine.connect` if the engine's socket does not exist, without importing the client.

    Raises:
        WorkerError: If the socket does not exist.
    """
    if not has_socket():
        raise no_answer(os.strerror(errno.ENOENT))


def no_answer(reason: str) -> WorkerError:
    """The error that no engine answers; `reason` says why in a few words."""
    return WorkerError(
        f"no Docker engine answers at {engine_address()}: {reason}",
        hint="start it, let DOCKER_HOST name another one, or use processes: --runtime local",
    )
