"""Connects to a Docker engine, translates its errors, and asks it for the image of containers."""

from __future__ import annotations

import json
import os
import re
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from docker.client import DockerClient
from docker.errors import APIError, DockerException, ImageNotFound
from docker.models.images import Image
from urllib3.exceptions import HTTPError

from throwcollect.collect.runtimes.docker.address import engine_address, make_silence_error
from throwcollect.errors import WorkerError
from throwcollect.version import __version__

RMW_LABEL = "throwcollect.rmw"
"""Label with the middleware of the genuine rclpy in an image; missing if the image has no rclpy."""
BUILD_COMMAND = "make image"
"""Command that builds the image of this version, in a clone of the project."""

# The client raises any of the last three if a connection breaks in the middle of an answer or of a stream.
ENGINE_ERRORS = (DockerException, HTTPError, OSError, struct.error, json.JSONDecodeError)
"""The errors that the client raises when the engine refuses, fails or has ended."""

PATIENCE_S = 30.0
"""Time that a request waits for an answer of the engine by default."""
_SYSTEM_ERROR = re.compile(r"Error\(\d+, '([^']+)'\)")


def connect(*, timeout_s: float = PATIENCE_S) -> DockerClient:
    """Connect to the engine at `engine_address`; each request waits for `timeout_s` [s] at most.

    An engine of another machine is refused: its containers have no directories of this one, and processes of this one
    do not reach them. One with a socket in the file system is here; one that is reached by TCP or SSH gives an address.
    """
    # Not all versions of the client look at the context.
    address = engine_address()
    try:
        client = DockerClient.from_env(timeout=timeout_s, environment={**os.environ, "DOCKER_HOST": address})
        machine = socket.gethostname() if address.startswith("unix:") else str(client.info()["Name"])
    except ENGINE_ERRORS as error:
        raise make_silence_error(describe_error(error)) from error
    if machine != socket.gethostname():
        raise WorkerError(
            f"the Docker engine at {address} is on another machine, {machine}, without directories of this one",
            hint=f"run throwcollect on {machine}, or use processes: --runtime local",
        )
    return client


def describe_error(error: BaseException) -> str:
    """The reason that the engine, or else the operating system, gives for an error."""
    if isinstance(error, APIError):
        return str(error.explanation or error).strip()
    if timed_out(error):
        return "no answer in time"
    # The client puts errors of the system into the arguments of its own, and these into messages.
    system = _SYSTEM_ERROR.findall(str(error))
    return system[-1] if system else str(error) or type(error).__name__


def timed_out(error: BaseException) -> bool:
    """Whether the engine did not answer in time, as opposed to refusing or being gone."""
    return isinstance(error, TimeoutError) or "timed out" in str(error)


@contextmanager
def engine_errors(what: str, *, hint: str | None = None) -> Iterator[None]:
    """Replace errors of the engine in this block by ours, whose message begins with `what`."""
    try:
        yield
    except ENGINE_ERRORS as error:
        raise WorkerError(f"{what}: {describe_error(error)}", hint=hint) from error


def default_tag() -> str:
    """Tag of the image of this version."""
    return f"throwcollect:{__version__}"


def ensure(client: DockerClient, tag: str, *, say: Callable[[str], None]) -> Image:
    """Find an image of the engine: any other than the default one is pulled if it is missing."""
    if (found := find_image(client, tag)) is not None:
        return found
    if tag == default_tag():
        raise WorkerError(f"the image {tag} is not here; {BUILD_COMMAND}, in a clone of the project, builds it")
    say(f"image {tag} is not here; pulling it")
    with engine_errors(f"the image {tag} is not here and cannot be pulled", hint="docker load brings one from a file"):
        return client.images.pull(tag)


def find_image(client: DockerClient, name: str) -> Image | None:
    """Find an image of the engine, with its labels; None if the engine does not have it."""
    with engine_errors(f"the engine does not report whether it has the image {name}"):
        try:
            return client.images.get(name)
        except ImageNotFound:
            return None
