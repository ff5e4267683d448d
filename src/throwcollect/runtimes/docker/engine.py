"""The way to a Docker engine, and what it says when something is wrong."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager

from docker.client import DockerClient
from docker.errors import APIError, DockerException
from requests.exceptions import Timeout
from urllib3.exceptions import HTTPError
from urllib3.exceptions import TimeoutError as PoolTimeoutError

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.address import no_answer

# Connections that break in the middle of an answer or of a stream show as any of the last three.
ENGINE_ERRORS = (DockerException, HTTPError, OSError, struct.error, json.JSONDecodeError)
"""Whatever the client raises when the engine refuses, fails or is gone."""

PATIENCE_S = 30.0
"""How long a command waits for an answer of the engine, unless it knows better."""

_TIMEOUTS = (Timeout, PoolTimeoutError, TimeoutError)


def connect(*, timeout_s: float | None = None) -> DockerClient:
    """A client of the engine that ``DOCKER_HOST`` names.

    Args:
        timeout_s: How long to wait for each answer [s]; None for `PATIENCE_S`.

    Raises:
        WorkerError: If no engine answers.
    """
    try:
        return DockerClient.from_env(timeout=timeout_s or PATIENCE_S)
    except ENGINE_ERRORS as error:
        raise no_answer(in_words(error)) from error


def in_words(error: BaseException) -> str:
    """What the engine, or else the system, said."""
    if isinstance(error, APIError):
        return str(error.explanation or error).strip()
    if timed_out(error):
        return "no answer in time"
    for each in _causes(error):
        if isinstance(each, OSError) and isinstance(each.strerror, str):
            return each.strerror
    return str(error) or type(error).__name__


def timed_out(error: BaseException) -> bool:
    """Whether something failed because the engine did not answer in time, as opposed to refusing or being gone."""
    return any(isinstance(each, _TIMEOUTS) for each in _causes(error))


def _causes(error: BaseException) -> Iterator[object]:
    """An exception and all that led to it, each after what it wraps."""
    cause: BaseException | None = error
    while cause is not None:
        yield from _inside(cause)
        yield cause
        cause = cause.__cause__ or cause.__context__


def _inside(error: BaseException) -> Iterator[object]:
    """What an exception wraps as its arguments, at any depth."""
    for argument in error.args:
        for each in argument if isinstance(argument, tuple) else (argument,):
            yield each
            if isinstance(each, BaseException):
                yield from _inside(each)


@contextmanager
def engine_errors(what: str, *, hint: str | None = None) -> Iterator[None]:
    """Errors of the engine become ours.

    Args:
        what: What could not be done, for the message.
        hint: One command or one edit that gets further.

    Raises:
        WorkerError: In the place of any of `ENGINE_ERRORS`.
    """
    try:
        yield
    except ENGINE_ERRORS as error:
        raise WorkerError(f"{what}: {in_words(error)}", hint=hint) from error
