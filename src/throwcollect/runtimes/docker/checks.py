"""Checks before the start that an engine and this machine have everything that a configuration asks for."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.config.containers import ContainerSpec, NodeContainerConfig
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.runtimes.docker.address import engine_address
from throwcollect.runtimes.docker.container_options import (
    image,
    mount_source,
    mount_target,
)
from throwcollect.runtimes.docker.docker_engine import BUILD_COMMAND, default_tag, engine_errors
from throwcollect.runtimes.docker.host_paths import DEVICES, is_allowed_device, refusal
from throwcollect.state_directory import state_directory


def check(client: DockerClient, config: Config) -> str:
    """Check the image, the mounts and the networks of a run.

    Returns:
        Id of the image, which is a SHA-256 of its content.
    """
    kinds = ("router", "sim", "coordinator")
    return _check(client, image(config), {f"containers.{kind}": getattr(config.containers, kind) for kind in kinds})


def check_container(client: DockerClient, spec: ContainerSpec, component: str) -> None:
    """Check the image, the mounts and the networks of a container that the catalogue describes for a component."""
    _check(client, spec.image, {f"components.{component}": spec.section}, mounts="volumes")


def _check(
    client: DockerClient, name: str, sections: Mapping[str, NodeContainerConfig], *, mounts: str = "mounts"
) -> str:
    with engine_errors("the Docker engine cannot be asked"):
        # The network of the host, and none at all, are in the list of every engine.
        networks = {each["Name"] for each in client.api.networks()} - {"host", "none"}
        root = os.path.realpath(client.api.info()["DockerRootDir"])
        try:
            image_id = str(client.images.get(name).id)
        except ImageNotFound as error:
            hint = BUILD_COMMAND if name == default_tag() else f"docker pull {name}"
            raise WorkerError(f"the Docker engine has no image {name}", hint=hint) from error
    problems: list[Problem] = []
    for key, section in sections.items():
        problems += _problems(key, section, networks, root, mounts=mounts)
    if problems:
        raise ConfigError(problems)
    return image_id


def _problems(
    key: str, section: NodeContainerConfig, networks: set[str], root: str, *, mounts: str
) -> Iterator[Problem]:
    for index, mount in enumerate(section.mounts):
        wrong = _wrong_mount(mount_source(mount), root) or _wrong_target(mount_target(mount))
        if wrong is not None:
            yield Problem(wrong, f"{key}.{mounts}.{index}")
    for index, device in enumerate(section.options.get("devices", [])):
        if (wrong := _wrong_device(Path(device.partition(":")[0]))) is not None:
            yield Problem(wrong, f"{key}.options.devices.{index}")
    for index, network in enumerate(section.networks):
        if network not in networks:
            wrong = f"the Docker engine has no network {network}; create it first"
            yield Problem(wrong, f"{key}.networks.{index}")


def _wrong_target(target: PurePosixPath) -> str | None:
    """Why nothing must be mounted at a path in a container; None if it may."""
    first = target.parts[1:2]
    taken = not first or first[0] in ("data", "key")
    return f"{target} is refused, as the dataset, the key or the image is there in the container" if taken else None


def _wrong_mount(source: Path, root: str) -> str | None:
    """Why a path, or the target of a link, must not be mounted; None if it may. `root` holds the engine's files."""
    if not source.exists():
        return f"{source} does not exist on this machine"
    real = source.resolve()
    if real.is_socket():
        return f"{source} is refused, as it is a socket; mounts are for data"
    kind, _, address = engine_address().partition("://")
    # The keys of all runs lie in the directory of the state.
    more = [root, str(state_directory().resolve()), *([os.path.realpath(address)] if kind == "unix" else [])]
    reason = refusal(str(real), more=more)
    if reason is None and Path.home().resolve().is_relative_to(real):
        reason = "is refused, as a home directory holds secrets; mounts are for data"
    if reason is None:
        return None
    return f"{source} {reason}" if real == source else f"{source}, which is {real}, {reason}"


def _wrong_device(device: Path) -> str | None:
    """Why a container must not get a device, or its target if it is a link; None if it may."""
    if not device.exists():
        return f"{device} does not exist on this machine"
    files = [device, *device.rglob("*")] if device.is_dir() else [device]
    if all(is_allowed_device(str(file.resolve())) and not file.is_block_device() for file in files):
        return None
    return f"{device} is refused, as it leads to other devices; containers get {DEVICES}"
