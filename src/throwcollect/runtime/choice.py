"""Whether the nodes of a run live in processes or in containers, and whether they run on genuine rclpy."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from typing import Literal

from docker.client import DockerClient

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.middleware import wanted as wanted_middleware
from throwcollect.runtime.docker_engine import connect, engine_address, is_local
from throwcollect.runtime.docker_options import image
from throwcollect.runtime.image import build, ensure, is_outdated, rmw_of

_PROBE_S = 3.0
"""Where processes will do as well, an engine that takes longer to answer is as good as none."""


@dataclass(frozen=True)
class Choice:
    """Where the nodes of a run live, and what carries their messages."""

    runtime: Literal["local", "docker"]
    middleware: Middleware


def choose(config: Config, *, say: Callable[[str], None], warn: Callable[[str], None]) -> Choice:
    """What a configuration asks for; with ``auto``, containers where they can be had, and rclpy where it is installed.

    Args:
        config: The configuration.
        say: Told in one line what was chosen, and before that what is done to get the image.
        warn: Told in one line if the image is not that of the sources that run here.

    Raises:
        ConfigError: If rclpy is asked for, and is not there.
        WorkerError: If containers are asked for, and no engine answers or the image cannot be had.
    """
    wanted = config.run.runtime
    middleware = wanted_middleware(config.run.ros)
    if wanted == "local":
        say(f"runtime: local processes{_on(middleware)}")
        return Choice("local", middleware)
    try:
        with closing(connect(timeout_s=None if wanted == "docker" else _PROBE_S)) as client:
            ensure(client, image(config), say=say)
            if is_outdated(client, image(config)):
                _settle(client, config, warn)
            in_containers = _of_image(client, config, middleware)
    except WorkerError as error:
        if wanted == "docker":
            raise
        say(f"runtime: local processes{_on(middleware)} (auto, as {error.message})")
        return Choice("local", middleware)
    auto = " (auto)" if wanted == "auto" else ""
    say(f"runtime: Docker containers of {image(config)}{_on(in_containers)}{auto}")
    return Choice("docker", in_containers)


def _on(middleware: Middleware) -> str:
    return f" on genuine rclpy with {middleware.rmw}" if middleware.backend == "rclpy" else ""


def _of_image(client: DockerClient, config: Config, launcher: Middleware) -> Middleware:
    """What carries the messages of containers: what their image has and the launcher can join.

    Raises:
        ConfigError: If rclpy is asked for, and the image has none, or the launcher could not join its nodes.
    """
    rmw = rmw_of(client, image(config))
    if rmw is None:
        problem = f"the image {image(config)} has no rclpy"
    elif (found := Middleware("rclpy", rmw)).joining.backend == "embedded":
        return found if config.run.ros != "embedded" else Middleware()
    elif not is_local():
        problem = f"with {rmw} nodes talk to each other directly, and those at {engine_address()} cannot be reached"
    else:
        return found if launcher.rmw == rmw else Middleware()
    if config.run.ros == "rclpy":
        raise ConfigError([Problem(problem, key="run.ros")], expected="embedded, or auto")
    return Middleware()


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
