"""Keys for runs in containers: the image, the volume, and the options of each kind of node."""

from __future__ import annotations

import re
from collections.abc import Iterator
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
_OWN_VARIABLES = (
    *("THROWCOLLECT_NODE", "THROWCOLLECT_KEY", "THROWCOLLECT_HOST", "THROWCOLLECT_DIRECTORY"),
    *("ZENOH_CONFIG_OVERRIDE", "ROS_DOMAIN_ID"),
)
_OWN_DIRECTORIES = ("/data", "/key")
_SOCKETS = ("docker.sock", "containerd.sock", "podman.sock")
_LABELS = "throwcollect."

_POWER = "is refused, as it would give a container power over its host"
_SEE = "should be left out; use {} beside options"
_LAUNCHER = "is refused, as the launcher decides it"
_REFUSED = {
    **dict.fromkeys(("privileged", "cap_add", "security_opt", "device_cgroup_rules", "volumes_from"), _POWER),
    **dict.fromkeys(("pid_mode", "ipc_mode", "uts_mode", "userns_mode", "cgroupns", "cgroup_parent"), _POWER),
    **dict.fromkeys(
        ("network_mode", "network_disabled", "network", "networking_config", "links"), _SEE.format("networks")
    ),
    **dict.fromkeys(("volumes", "mounts", "binds"), _SEE.format("mounts")),
    **dict.fromkeys(("mem_limit", "memswap_limit"), _SEE.format("memory")),
    **dict.fromkeys(("nano_cpus", "cpu_period", "cpu_quota", "cpu_count"), _SEE.format("cpus")),
    "cpuset_cpus": _SEE.format("cpuset"),
    "environment": _SEE.format("environment"),
    **dict.fromkeys(("ports", "publish_all_ports"), _SEE.format("ports")),
    **dict.fromkeys(("image", "command", "entrypoint", "name", "user", "working_dir", "healthcheck"), _LAUNCHER),
    **dict.fromkeys(("detach", "tty", "stdin_open", "auto_remove", "restart_policy", "log_config"), _LAUNCHER),
    **dict.fromkeys(("init", "read_only", "cap_drop", "stop_signal"), _LAUNCHER),
}


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


def _check_variable(text: str) -> str:
    if text in _OWN_VARIABLES:
        raise ValueError(_LAUNCHER)
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", text):
        raise ValueError("should be the name of a variable: letters, digits and _")
    return text


def _check_port(text: str) -> str:
    match = re.fullmatch(r"([1-9][0-9]{0,4})(/tcp|/udp)?", text)
    if match is None or int(match[1]) > 65535:
        raise ValueError("should be a port of the container from 1 to 65535, with /udp if it is not TCP")
    return text


def _check_label(text: str) -> str:
    if text.startswith(_LABELS):
        raise ValueError(f"is refused, as labels that begin with {_LABELS} are the launcher's")
    return text


def _check_tmpfs(text: str) -> str:
    if not text.startswith("/") or ".." in text.split("/") or normal_path(text) == "/" or _is_own_path(text):
        raise ValueError("should be an absolute path in the container, outside of /data and /key")
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
Volume = Annotated[
    str,
    match(r"[a-zA-Z0-9][a-zA-Z0-9_.-]+", "a volume's name: letters, digits, _, . and -"),
    in_words("a volume's name"),
]
Variable = Annotated[str, AfterValidator(_check_variable)]
ContainerPort = Annotated[str, AfterValidator(_check_port)]
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

    # Unknown keywords are errors. For those that Docker knows and we refuse, the message gives the reason.
    __pydantic_config__ = ConfigDict(**_OPTIONAL_KEYS, json_schema_extra={"refused": _REFUSED})  # type: ignore[misc]
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
    labels: dict[Annotated[str, AfterValidator(_check_label)], str]
    """Further labels."""
    group_add: list[str | int]
    """Further groups of the process."""
    shm_size: Size
    """Size of /dev/shm."""
    tmpfs: dict[Annotated[str, AfterValidator(_check_tmpfs)], str]
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

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        for port in self.ports:
            if port.endswith("/tcp") and (same := port.removesuffix("/tcp")) in self.ports:
                yield f"ports.{port}", f"should be left out, as {same} is the same port"


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
    """Image of all nodes; null takes `throwcollect` of this version, which is built if it is missing."""
    volume: Volume | None = None
    """Volume of the engine that holds the dataset; null writes it to a directory of this machine."""
    router: NodeContainerConfig = NodeContainerConfig()
    """The router."""
    sim: NodeContainerConfig = NodeContainerConfig()
    """Each simulation."""
    coordinator: NodeContainerConfig = NodeContainerConfig()
    """The coordinator."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        taken: dict[int, str] = {}
        for node in ("router", "sim", "coordinator"):
            for port, host_port in getattr(self, node).ports.items():
                key = f"{node}.ports.{port}"
                if host_port in taken:
                    yield key, f"should differ from {taken[host_port]}, got {host_port}, too"
                taken.setdefault(host_port, key)
