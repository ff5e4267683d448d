"""The address of the Docker engine, and a check of its socket that spares the long import of the client."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from pathlib import Path

from throwcollect.errors import WorkerError

_DEFAULT_HOST = "unix:///var/run/docker.sock"


def engine_address() -> str:
    """Find the address of the engine as the command ``docker`` does: by ``DOCKER_HOST`` or its context."""
    if address := os.environ.get("DOCKER_HOST"):
        return address
    settings = Path(os.environ.get("DOCKER_CONFIG") or os.path.expanduser("~/.docker"))
    context = os.environ.get("DOCKER_CONTEXT") or _read_current_context(settings / "config.json")
    if context in ("", "default"):
        return _DEFAULT_HOST
    path = settings / "contexts" / "meta" / hashlib.sha256(context.encode()).hexdigest() / "meta.json"
    try:
        return str(json.loads(path.read_bytes())["Endpoints"]["docker"]["Host"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        problem = f"the command docker has no usable context {context!r}"
        raise WorkerError(problem, hint="docker context ls lists all; or use processes: --runtime local") from error


def _read_current_context(path: Path) -> str:
    try:
        return str(json.loads(path.read_bytes()).get("currentContext") or "")
    except (OSError, ValueError, AttributeError):
        # The command, too, takes the usual socket if its settings cannot be read.
        return ""


def has_socket() -> bool:
    """Whether the engine's socket exists; true also for an engine that has no socket in the file system."""
    try:
        path = engine_address().removeprefix("unix://")
    except WorkerError:
        return False
    return not path.startswith("/") or Path(path).exists()


def check_socket() -> None:
    """Raise the error of `docker_engine.connect` if the engine has no socket, without importing the client."""
    engine_address()
    if not has_socket():
        raise make_silence_error(os.strerror(errno.ENOENT))


def make_silence_error(reason: str) -> WorkerError:
    """The error that no engine answers; `reason` is the cause in a few words."""
    return WorkerError(
        f"no Docker engine answers at {engine_address()}: {reason}",
        hint="start it, let DOCKER_HOST name another one, or use processes: --runtime local",
    )
