"""Whether an engine and this machine have what a configuration asks for; looked at before anything is started."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.runtime.docker_engine import engine_address, engine_errors
from throwcollect.runtime.docker_options import RUN_LABEL, RunPlace, image, mount_source, section_of
from throwcollect.runtime.image import default_tag
from throwcollect.runtime.nodes import COORDINATOR, ROUTER
from throwcollect.runtime.ports import reserved_port

_NODES = {"router": ROUTER, "sim": "sim_0", "coordinator": COORDINATOR}


def check(client: DockerClient, place: RunPlace, config: Config) -> None:
    """Look for the image, the mounts, the networks, and the router's port.

    Args:
        client: Client of the engine.
        place: The run.
        config: Its configuration.

    Raises:
        ConfigError: If a mount or a network is not there or must not be used, or the router's port is taken.
        WorkerError: If the engine does not answer, or does not have the image.
    """
    with engine_errors("the Docker engine cannot be asked"):
        networks = {each["Name"] for each in client.api.networks()}
        # Those of a launcher that died hold their ports, and go on with them.
        begun = client.api.containers(all=True, filters={"label": f"{RUN_LABEL}={place.run_id}"})
        try:
            client.images.get(image(config))
        except ImageNotFound as error:
            name = image(config)
            hint = "throwcollect image build" if name == default_tag() else f"docker pull {name}"
            raise WorkerError(f"the Docker engine has no image {name}", hint=hint) from error
    if problems := list(_problems(config, networks)):
        raise ConfigError(problems)
    if config.run.router_port and not begun:
        reserved_port(config.run.router_port).close()


def _problems(config: Config, networks: set[str]) -> Iterator[Problem]:
    for section, node in _NODES.items():
        wanted = section_of(config, node)
        for index, mount in enumerate(wanted.mounts):
            source = mount_source(mount)
            key = f"containers.{section}.mounts.{index}"
            if not source.exists():
                yield Problem(f"{source} does not exist on this machine", key)
            elif _holds_engine(source):
                yield Problem(f"{source} is refused, as it holds the engine's socket", key)
        for index, network in enumerate(wanted.networks):
            if network not in networks:
                key = f"containers.{section}.networks.{index}"
                yield Problem(f"the Docker engine has no network {network}; create it first", key)


def _holds_engine(source: Path) -> bool:
    kind, _, path = engine_address().partition("://")
    real = os.path.realpath(path)
    return kind == "unix" and os.path.commonpath([real, os.path.realpath(source)]) == os.path.realpath(source)
