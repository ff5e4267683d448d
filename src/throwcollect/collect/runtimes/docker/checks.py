"""Checks before the start that an engine and this machine have everything that a configuration asks for."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from docker.client import DockerClient

from throwcollect.collect.runtimes.docker.address import engine_address
from throwcollect.collect.runtimes.docker.container_options import choose_image
from throwcollect.collect.runtimes.docker.docker_engine import BUILD_COMMAND, default_tag, engine_errors, find_image
from throwcollect.config.run import ContainerSpec, NodeContainerConfig
from throwcollect.config.schema import Config
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.state_directory import state_directory

_SYSTEM = (
    *("/bin", "/boot", "/dev", "/etc", "/lib", "/lib32", "/lib64", "/libx32", "/lost+found", "/proc"),
    *("/run", "/sbin", "/sys", "/usr", "/var/backups", "/var/cache", "/var/lib", "/var/lock", "/var/log", "/var/mail"),
    *("/var/run", "/var/spool"),
)
"""Directories of the system. Neither what is in them nor a directory that contains one of them may be mounted."""

_SHARED = ("/home", "/tmp", "/var/tmp")  # noqa: S108
"""Directories that all users and programs share; directories in them may be data."""

_HOME = re.compile("/root|/home/[^/]+")
"""Home directories. What begins with a dot in them belongs to programs, and is full of keys and passwords."""


def check(client: DockerClient, config: Config) -> str:
    """Check the image, the mounts and the networks of a run.

    Returns:
        Id of the image, which is a SHA-256 of its content.
    """
    kinds = ("router", "sim", "coordinator")
    return _check(
        client, choose_image(config), {f"containers.{kind}": getattr(config.containers, kind) for kind in kinds}
    )


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
    if (found := find_image(client, name)) is None:
        hint = BUILD_COMMAND if name == default_tag() else f"docker pull {name}"
        raise WorkerError(f"the Docker engine has no image {name}", hint=hint)
    problems: list[Problem] = []
    for key, section in sections.items():
        problems += _find_problems(key, section, networks, root, mounts=mounts)
    if problems:
        raise ConfigError(problems)
    return str(found.id)


def _find_problems(
    key: str, section: NodeContainerConfig, networks: set[str], root: str, *, mounts: str
) -> Iterator[Problem]:
    for index, mount in enumerate(section.mounts):
        source, target, *_ = mount.split(":")
        wrong = _refuse_mount(Path(source), root) or _refuse_target(target)
        if wrong is not None:
            yield Problem(wrong, f"{key}.{mounts}.{index}")
    for index, network in enumerate(section.networks):
        if network not in networks:
            wrong = f"the Docker engine has no network {network}; create it first"
            yield Problem(wrong, f"{key}.networks.{index}")


def _refuse_target(path: str) -> str | None:
    """Why nothing must be mounted at a path in a container; None if it may."""
    target = PurePosixPath(posixpath.normpath(path))
    first = target.parts[1:2]
    taken = not first or first[0] in ("data", "key")
    return f"{target} is refused, as the dataset, the key or the image is there in the container" if taken else None


def _refuse_mount(source: Path, root: str) -> str | None:
    """Why a path, or the target of a link, must not be mounted; None if it may. `root` holds the engine's files."""
    if not source.exists():
        return f"{source} does not exist on this machine"
    real = source.resolve()
    kind, _, address = engine_address().partition("://")
    # The keys of all runs lie in the directory of the state.
    system = [root, str(state_directory().resolve()), *([os.path.realpath(address)] if kind == "unix" else [])]
    if (reason := find_secret(real, system)) is None:
        return None
    shown = source if real == source else f"{source}, which is {real},"
    return f"{shown} is refused, as {reason}; mounts are for data"


def find_secret(real: Path, system: Iterable[str] = ()) -> str | None:
    """Explain why a directory or file must not be mounted, even for reading, as it may hold secrets; None if it may.

    The path leads through no links; `system` are further directories of the system, such as those of the engine.
    """
    path = str(real)
    if real.is_socket():
        return "it is a socket"
    if path in _SHARED:
        return f"all users of the machine share {path}"
    for place in (*_SYSTEM, *system):
        if os.path.commonpath([path, place]) in (path, place):
            return f"{place} belongs to the system"
    if _HOME.fullmatch(path) or Path.home().resolve().is_relative_to(real):
        return "a home directory holds secrets"
    hidden = next((part for part in real.parts if part.startswith(".")), None)
    return None if hidden is None else f"{hidden} may hold secrets of programs"
