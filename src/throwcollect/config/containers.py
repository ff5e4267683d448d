"""Keys for runs in containers: the image, and the options of each kind of node."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import ConfigDict, Field, PositiveInt
from typing_extensions import TypedDict

from throwcollect.config.kinds import NUMBER_AS_TEXT
from throwcollect.config.section import Section

Size = Annotated[str, Field(pattern=r"^[1-9][0-9]{0,17}[bkmg]?$")]
Cores = Annotated[str, NUMBER_AS_TEXT, Field(pattern=r"^[0-9]+(-[0-9]+)?(,[0-9]+(-[0-9]+)?)*$")]
# Which directories and devices of the host may be used is checked when a run begins, after links have been followed.
Mount = Annotated[str, Field(pattern=r"^/[^/:][^:]*:/[^:]*(:(ro|(ro,)?[zZ]))?$")]
Device = Annotated[str, Field(pattern=r"^/dev/[^:]+:/dev/[^:]+:(r|w|rw)$")]
Variable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
ContainerPort = Annotated[str, Field(pattern=r"^[1-9][0-9]{0,4}(/tcp|/udp)?$")]
HostPort = Annotated[int, Field(ge=1, le=65535)]


class ContainerOptions(TypedDict, total=False):
    """Further keywords of `docker.containers.create` of the Docker SDK for Python; by default they are the engine's.

    No others are allowed: they would give a container power over its host, or are decided by the launcher.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")  # type: ignore[misc]
    dns: Annotated[list[str], Field(description="Addresses of name servers.")]
    extra_hosts: Annotated[dict[str, str], Field(description="Further host names and their addresses.")]
    labels: Annotated[dict[str, str], Field(description="Further labels.")]
    group_add: Annotated[list[str | int], Field(description="Further groups of the process.")]
    shm_size: Annotated[Size, Field(description="Size of /dev/shm, such as `512m`.")]
    tmpfs: Annotated[
        dict[str, str],
        Field(
            description="Further directories in memory and their mount options; options for /tmp are added to those "
            "that it has anyway."
        ),
    ]
    ulimits: Annotated[dict[str, int], Field(description="Resource limits by their names, such as `nofile`.")]
    pids_limit: Annotated[PositiveInt, Field(description="Upper bound of threads and processes, instead of 512.")]
    devices: Annotated[
        list[Device],
        Field(
            description="Graphics processors of the host as HOST:CONTAINER:PERMISSIONS, such as `/dev/dri:/dev/dri:rw`."
        ),
    ]
    gpus: Annotated[
        int,
        Field(ge=-1, description="Number of GPUs that the engine provides, as `docker run --gpus` does; -1 for all."),
    ]
    runtime: Annotated[str, Field(description="OCI runtime that the engine knows, such as `nvidia`.")]


class NodeContainerConfig(Section):
    """Further properties of the containers of one kind of node."""

    cpus: Annotated[float, Field(ge=0.01, le=10_000)] | None = None
    """Upper bound of processor time, in cores."""
    memory: Size | None = None
    """Upper bound of memory, such as `512m` or `2g`; the container gets no swap beyond it."""
    cpuset: Cores | None = None
    """Cores that the container runs on, such as `0-3,6`; null: any core, but one core for each simulation if
    simulations fill all cores."""
    environment: dict[Variable, str | int | float] = {}
    """Further environment variables."""
    mounts: list[Mount] = []
    """Directories and files with data of the host that the container sees, too, as HOST:CONTAINER[:ro]; none inside
    /data or /key. `:z` or `:ro,z` labels them for all containers on hosts with SELinux, `Z` for this one alone."""
    networks: list[str] = []
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
    router: NodeContainerConfig = NodeContainerConfig()
    """The router."""
    sim: NodeContainerConfig = NodeContainerConfig()
    """Each simulation."""
    coordinator: NodeContainerConfig = NodeContainerConfig()
    """The coordinator."""
