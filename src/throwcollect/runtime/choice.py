"""Whether the nodes of a run live in processes or in containers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import Literal

from docker.client import DockerClient

from throwcollect.config.schema import Config
from throwcollect.errors import WorkerError
from throwcollect.runtime.docker_engine import connect
from throwcollect.runtime.docker_options import image
from throwcollect.runtime.image import build, ensure, is_outdated

_PROBE_S = 3.0
"""Where processes will do as well, an engine that takes longer to answer is as good as none."""


def choose(config: Config, *, say: Callable[[str], None], warn: Callable[[str], None]) -> Literal["local", "docker"]:
    """The runtime that a configuration asks for; with ``auto``, containers where they can be had.

    Args:
        config: The configuration.
        say: Told in one line what was chosen, and before that what is done to get the image.
        warn: Told in one line if the image is not that of the sources that run here.

    Raises:
        WorkerError: If containers are asked for, and no engine answers or the image cannot be had.
    """
    wanted = config.run.runtime
    if wanted == "local":
        say("runtime: local processes")
        return "local"
    try:
        with closing(connect(timeout_s=None if wanted == "docker" else _PROBE_S)) as client:
            ensure(client, image(config), say=say)
            if is_outdated(client, image(config)):
                _settle(client, config, warn)
    except WorkerError as error:
        if wanted == "docker":
            raise
        say(f"runtime: local processes (auto, as {error.message})")
        return "local"
    say(f"runtime: Docker containers of {image(config)}{' (auto)' if wanted == 'auto' else ''}")
    return "docker"


def _settle(client: DockerClient, config: Config, warn: Callable[[str], None]) -> None:
    """Decide about an image of other sources: it may collect other bytes than these, so it is used on demand only."""
    name = image(config)
    finding = f"the image {name} was made from other sources than these"
    if config.containers.image is not None:
        warn(f"{finding}; it is used, as containers.image names it")
    elif config.run.runtime == "auto":
        raise WorkerError(f"{finding}; throwcollect image build makes it anew")
    else:
        warn(f"{finding}; building it anew, which takes minutes")
        build(client, name, say=lambda _line: None)
