"""The image of containers: whether the engine has it, and from which sources it was made."""

from __future__ import annotations

from collections.abc import Callable

from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.errors import WorkerError
from throwcollect.runtimes.docker.docker_engine import engine_errors
from throwcollect.runtimes.image_sources import SOURCES_LABEL, are_others
from throwcollect.version import __version__

RMW_LABEL = "throwcollect.rmw"
"""Label with the middleware of the genuine rclpy in an image; missing if the image has no rclpy."""
BUILD_COMMAND = "make image"
"""Command that builds the image of this version, in a clone of the project."""


def default_tag() -> str:
    """Tag of the image of this version."""
    return f"throwcollect:{__version__}"


def ensure(client: DockerClient, tag: str, *, say: Callable[[str], None]) -> None:
    """Make sure that the engine has an image: any other than the default one is pulled if it is missing."""
    if is_there(client, tag):
        return
    if tag == default_tag():
        raise WorkerError(f"the image {tag} is not here; {BUILD_COMMAND}, in a clone of the project, builds it")
    say(f"image {tag} is not here; pulling it")
    with engine_errors(f"the image {tag} is not here and cannot be pulled", hint="docker load brings one from a file"):
        client.images.pull(tag)


def is_outdated(client: DockerClient, tag: str) -> bool:
    """Whether an image of the engine was made from other sources than those of this package's clone."""
    return are_others(_read_label(client, tag, SOURCES_LABEL))


def rmw_of(client: DockerClient, tag: str) -> str | None:
    """Middleware of the genuine rclpy in an image of the engine; None if the image has no rclpy."""
    return _read_label(client, tag, RMW_LABEL)


def is_there(client: DockerClient, image: str) -> bool:
    """Whether the engine has an image."""
    with engine_errors(f"the engine does not say whether it has the image {image}"):
        try:
            client.images.get(image)
        except ImageNotFound:
            return False
        return True


def _read_label(client: DockerClient, tag: str, name: str) -> str | None:
    with engine_errors(f"the engine does not say what the image {tag} holds"):
        label = client.images.get(tag).labels.get(name)
    return label if isinstance(label, str) else None
