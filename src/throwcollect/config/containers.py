"""Keys for runs in containers: the image, and the options of each kind of node."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field, PositiveInt
from typing_extensions import TypedDict

from throwcollect.config.host_paths import DEVICES, is_allowed_device, normal_path, refusal
from throwcollect.config.kinds import NUMBER_AS_TEXT, in_words, match
from throwcollect.config.section import Section

_LEAST_MEMORY = 6 * 1024**2
"""Smallest limit of memory that Docker engines accept [bytes]."""

_SIZE_UNITS = {"": 1, "b": 1, "k": 1024, "m": 1024**2, "g": 1024**3}
_OWN_DIRECTORIES = ("/data", "/key")
_SOCKETS = ("docker.sock", "containerd.sock", "podman.sock")


def _check_size(text: str) -> str:
    match = re.fullmatch(r"([1-9][0-9]{0,17})([bkmg]?)", text)
    if match is None or int(match[1]) * _SIZE_UNITS[match[2]] < _LEAST_MEMORY:
        raise ValueError(f"should be a size of 6m or more, such as 512m or 2g, got '{text}'")
    return text


def _is_own_path(text: str) -> bool:
    """Whether a path in a container is in the directory of the dataset or the key, which belong to the runtime."""
    path = PurePosixPath(normal_path(text))
    return any(PurePosixPath(own) in (path, *path.parents) for own in _OWN_DIRECTORIES)


def _check_mount(text: str) -> str:
    source, _, rest = text.partition(":")
    target, _, mode = rest.partition(":")
    # With `..` in it, the path that is checked would not be the one that is mounted.
    if not (source.startswith("/") and target.startswith("/")) or ".." in text.split("/") or mode not in ("", "ro"):
        raise ValueError(f"should be HOST:CONTAINER or HOST:CONTAINER:ro with absolute paths, got '{text}'")
    if normal_path(source).endswith(_SOCKETS):
        raise ValueError(f"{source} is refused, as it is an engine's socket, and gives power over the host")
    if reason := refusal(source):
        raise ValueError(f"{source} {reason}")
    if _is_own_path(target) or normal_path(target) == "/":
        raise ValueError(f"{target} is refused, as the dataset, the key or the image is there in the container")
    return text


def _check_network(text: str) -> str:
    if text in ("host", "none") or text.startswith("container:"):
        raise ValueError(f"{text} is refused; name a network of the engine, which is joined besides the run's own")
    return text


def _check_device(text: str) -> str:
    host, _, rest = text.partition(":")
    inside, _, permissions = rest.partition(":")
    if not inside.startswith("/dev/") or ".." in inside.split("/") or permissions not in ("r", "w", "rw"):
        raise ValueError(f"should be HOST:CONTAINER:PERMISSIONS, such as /dev/dri:/dev/dri:rw, got '{text}'")
    if not is_allowed_device(host):
        raise ValueError(f"{host} is refused; containers get {DEVICES}")
    return text


Size = Annotated[str, AfterValidator(_check_size), in_words("a size such as 512m or 2g")]
Cores = Annotated[
    str,
    NUMBER_AS_TEXT,
    match(r"\d+(-\d+)?(,\d+(-\d+)?)*", "numbers and ranges of cores, such as 0-3,6"),
    in_words("cores such as 0-3,6"),
]
Mount = Annotated[str, AfterValidator(_check_mount), in_words("HOST:CONTAINER[:ro]")]
Network = Annotated[str, AfterValidator(_check_network), in_words("names of networks")]
Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
ContainerPort = Annotated[str, Field(pattern=r"^[1-9][0-9]{0,4}(/tcp|/udp)?$")]
HostPort = Annotated[int, Field(ge=1, le=65535)]
Device = Annotated[str, AfterValidator(_check_device), in_words("HOST:CONTAINER:PERMISSIONS")]

_OPTIONAL_KEYS = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class DeviceRequest(TypedDict, total=False):
    """Devices such as GPUs that a driver of the engine provides."""

    __pydantic_config__ = _OPTIONAL_KEYS  # type: ignore[misc]
    driver: str
    """Driver, such as `nvidia`."""
    count: int
    """Number of devices; -1 for all."""
    device_ids: list[str]
    """Names of devices, instead of a number."""
    capabilities: list[list[str]]
    """Alternatives of what the devices must be able to do, such as `[[gpu]]`."""
    options: dict[str, str]
    """Further options for the driver."""


class ContainerOptions(TypedDict, total=False):
    """Further keywords of `docker.containers.create` of the Docker SDK for Python; by default they are the engine's."""

    # Keywords that are not listed here are errors: they would give a container power over its host, or are decided by
    # the launcher, or by the keys beside `options`.
    __pydantic_config__ = _OPTIONAL_KEYS  # type: ignore[misc]
    hostname: str
    """Name of the host inside."""
    domainname: str
    """Domain of the host inside."""
    dns: list[str]
    """Addresses of name servers."""
    dns_search: list[str]
    """Domains in which names are looked up."""
    dns_opt: list[str]
    """Options of the resolver."""
    extra_hosts: dict[str, str]
    """Further host names and their addresses."""
    labels: dict[str, str]
    """Further labels."""
    group_add: list[str | int]
    """Further groups of the process."""
    shm_size: Size
    """Size of /dev/shm."""
    tmpfs: dict[str, str]
    """Further directories in memory and their mount options; options for /tmp are added to those that it has anyway."""
    ulimits: dict[str, int]
    """Resource limits by their names, such as `nofile`."""
    sysctls: dict[str, str | int]
    """Kernel parameters of the container's namespaces."""
    pids_limit: PositiveInt
    """Upper bound of threads and processes, instead of 512."""
    mem_reservation: Size
    """Memory to which the container is limited when the host runs short of it."""
    oom_score_adj: Annotated[int, Field(ge=-1000, le=1000)]
    """How readily the kernel ends the container when the host runs out of memory."""
    cpu_shares: PositiveInt
    """Share of computing time, relative to that of other containers; 1024 if absent."""
    cpuset_mems: Cores
    """NUMA nodes whose memory the container uses."""
    blkio_weight: Annotated[int, Field(ge=10, le=1000)]
    """Share of disk access, relative to that of other containers."""
    devices: list[Device]
    """Graphics processors of the host as HOST:CONTAINER:PERMISSIONS, such as `/dev/dri:/dev/dri:rw`."""
    device_requests: list[DeviceRequest]
    """Devices that a driver provides, such as GPUs."""
    runtime: str
    """OCI runtime that the engine knows, such as `nvidia`."""


class NodeContainerConfig(Section):
    """Further properties of the containers of one kind of node."""

    cpus: Annotated[float, Field(ge=0.01, le=10_000)] | None = None
    """Upper bound of processor time, in cores."""
    memory: Size | None = None
    """Upper bound of memory; the container gets no swap beyond it."""
    cpuset: Cores | None = None
    """Cores that the container runs on; null: any core, but one core for each simulation if simulations fill all
    cores."""
    environment: dict[Variable, str | int | float] = {}
    """Further environment variables."""
    mounts: list[Mount] = []
    """Directories and files with data of the host that the container sees, too; none inside /data or /key."""
    networks: list[Network] = []
    """Networks of the engine that the container joins besides the run's own."""
    ports: dict[ContainerPort, HostPort] = {}
    """Ports of the container (`80`, `53/udp`) and those of 127.0.0.1 at which they are published."""
    options: ContainerOptions = {}
    """Further options."""


@dataclass(frozen=True)
class ContainerSpec:
    """A container that a catalogue of `serve` describes as a component; it is no node of a run.

    Attributes:
        image: Its image.
        command: The command that it runs; None for the command of the image.
        section: All its other properties.
    """

    image: str
    command: tuple[str, ...] | None
    section: NodeContainerConfig


class ContainersConfig(Section):
    """How nodes run in containers; nothing in this section changes the dataset."""

    image: str | None = None
    """Image of all nodes; null takes `throwcollect` of this version (`make image`). Another one is pulled if it
    is missing."""
    volume: None = None
    """Always null; datasets of earlier versions have this key."""
    router: NodeContainerConfig = NodeContainerConfig()
    """The router."""
    sim: NodeContainerConfig = NodeContainerConfig()
    """Each simulation."""
    coordinator: NodeContainerConfig = NodeContainerConfig()
    """The coordinator."""
