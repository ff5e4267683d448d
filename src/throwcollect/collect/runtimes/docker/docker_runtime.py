"""The runtime ``docker``: whether an engine can be used, and the end of everything that it holds of a run.

The client of the engine is imported only when it is needed, because most commands only ask whether there is an engine.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING

from throwcollect.collect.runtimes.docker.address import check_socket, engine_address, has_socket
from throwcollect.collect.runtimes.image_sources import SOURCES_LABEL, are_others
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.collect.runtimes.runtime import Check, Runtime
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.extras import is_installed
from throwcollect.ros.middleware import Middleware

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.reporter import Reporter
    from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes
    from throwcollect.config.schema import Config

_PROBE_S = 3.0
"""With ``run.runtime: auto``, an engine that takes longer to answer is not used."""


class DockerRuntime(Runtime):
    """Nodes as containers of a Docker engine, which outlive their launcher."""

    handle = "container"
    outlives_launcher = True

    def describe(self, config: Config) -> str:
        """See `Runtime.describe`."""
        from throwcollect.collect.runtimes.docker.container_options import choose_image

        return f"Docker containers of {choose_image(config)}"

    def host(self, record: RunRecord, config: Config, *, warn: Callable[[str], None]) -> DockerNodes:
        """Make the host of a run; see `Runtime.host`."""
        from throwcollect.collect.runtimes.docker.docker_nodes import DockerNodes

        return DockerNodes(record, config, warn=warn)

    def prepare(self, config: Config, middleware: Middleware, reporter: Reporter) -> Middleware:
        """Get the image, and find out the middleware of containers; see `Runtime.prepare`."""
        if is_installed("docker"):
            check_socket()
        from throwcollect.collect.runtimes.docker import docker_engine as docker
        from throwcollect.collect.runtimes.docker.container_options import choose_image

        name, patience_s = choose_image(config), docker.PATIENCE_S if config.run.runtime == "docker" else _PROBE_S
        with closing(docker.connect(timeout_s=patience_s)) as client:
            labels = docker.ensure(client, name, say=reporter.say).labels
            if are_others(labels.get(SOURCES_LABEL)):
                finding = f"the image {name} was made from other sources than these"
                # It may collect other bytes, so it is used only if the user has named it.
                if config.containers.image is None:
                    raise WorkerError(f"{finding}; {docker.BUILD_COMMAND} builds it anew")
                reporter.warn(f"{finding}; it is used, as containers.image names it")
            return _choose_middleware(labels.get(docker.RMW_LABEL), name, config, middleware)

    def check(self) -> Check:
        """Whether an engine answers, and has the image of these sources."""
        from throwcollect.collect.runtimes.docker import docker_engine as docker

        tag = docker.default_tag()
        try:
            with closing(docker.connect(timeout_s=_PROBE_S)) as client, docker.engine_errors("the Docker engine fails"):
                engine = client.version()["Version"]
                found = f"Docker {engine} answers at {engine_address()}"
                if (image := docker.find_image(client, tag)) is None:
                    lacking = f"the image {tag} is not there yet; {docker.BUILD_COMMAND}, in a clone, builds it"
                    return Check("docker", "note", f"{found}; {lacking}")
                if are_others(image.labels.get(SOURCES_LABEL)):
                    old = f"the image {tag} was made from other sources than these"
                    return Check("docker", "note", f"{found}; {old}; {docker.BUILD_COMMAND} builds it anew")
        except WorkerError as error:
            return Check("docker", "note", f"{error.message}; runs use processes")
        return Check("docker", "ok", f"{found}, with the image {tag}")

    def remove(self, run: str) -> list[str]:
        """Remove containers and network; see `Runtime.remove`."""
        if not (is_installed("docker") and has_socket()):
            return []
        from throwcollect.collect.runtimes.docker.containers import remove
        from throwcollect.collect.runtimes.docker.docker_engine import connect, timed_out

        try:
            client = connect()
        except WorkerError as error:
            if error.__cause__ is None or not timed_out(error.__cause__):
                return []
            raise WorkerError(error.message, hint="try again once the Docker engine answers") from error
        with closing(client):
            return remove(client, run)


def _choose_middleware(rmw: str | None, image: str, config: Config, launcher: Middleware) -> Middleware:
    """Choose the middleware of containers: one that the image has, and over which the launcher can join the nodes."""
    if rmw is None:
        problem = f"the image {image} has no rclpy"
    # Every launcher has the embedded client, which speaks this protocol, and only has to reach the router.
    elif (found := Middleware("rclpy", rmw)).joining.backend == "embedded":
        return found if config.run.ros != "embedded" else Middleware()
    # With any other middleware, nodes talk to each other directly, and the launcher has to load the same one.
    elif launcher.rmw == rmw:
        return found
    else:
        problem = f"the image {image} has rclpy with {rmw}, and a launcher with {launcher.rmw} cannot join its nodes"
    if config.run.ros == "rclpy":
        raise ConfigError([Problem(problem, key="run.ros")], expected="embedded, or auto")
    return Middleware()
