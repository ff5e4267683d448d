"""Where the Docker engine is looked for, and whether its socket is there; the client takes long to import."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from throwcollect.errors import WorkerError

_DEFAULT_HOST = "unix:///var/run/docker.sock"


def engine_address() -> str:
    """Where the engine is looked for: ``DOCKER_HOST``, or the usual socket."""
    return os.environ.get("DOCKER_HOST") or _DEFAULT_HOST


def is_local() -> bool:
    """Whether the engine is that of this machine, so that its containers can be reached from here."""
    return engine_address().startswith("unix:")


def has_socket() -> bool:
    """Whether the engine's socket is there; of an engine that is reached otherwise, whether it can be asked."""
    path = engine_address().removeprefix("unix://")
    return not path.startswith("/") or Path(path).exists()


def check_socket() -> None:
    """Raise what a client would raise that does not find the engine's socket.

    Raises:
        WorkerError: If the socket is not there.
    """
    if not has_socket():
        raise no_answer(os.strerror(errno.ENOENT))


def no_answer(reason: str) -> WorkerError:
    """The error that no engine answers.

    Args:
        reason: Why, in a few words.
    """
    return WorkerError(
        f"no Docker engine answers at {engine_address()}: {reason}",
        hint="start it, let DOCKER_HOST name another one, or use processes: --runtime local",
    )
