"""Keys for how a collection is run: by which nodes, in which containers, and on which cluster."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import ConfigDict, Field, PositiveFloat, PositiveInt
from typing_extensions import TypedDict

from throwcollect.config.section import Section
from throwcollect.members import names_of

if TYPE_CHECKING:
    RuntimeName = str
else:
    # Packages may add runtimes, so their names are known only when the program runs.
    RuntimeName = Literal[("auto", *names_of("runtimes"))]


_PORT = "[1-9][0-9]{0,3}|[1-5][0-9]{4}|6([0-4][0-9]{3}|5([0-4][0-9]{2}|5([0-2][0-9]|3[0-5])))"
ListenAddress = Annotated[str, Field(pattern=rf"^tcp/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9.-]+):({_PORT})$")]


class RunConfig(Section):
    """How a collection is run; nothing in this section changes the dataset."""

    simulations: Annotated[int, Field(ge=0, le=256)] = 2
    """Number of simulations, unless `-n` gives another; 0 only with `listen`, if other machines run all of them."""
    runtime: RuntimeName = "auto"
    """Where the nodes run: in processes (`local`) or in containers.

    `auto` takes containers if an engine of this machine answers. `inprocess` takes one simulation without nodes: for
    tests, breakpoints and Python programs."""
    router_port: Annotated[int, Field(ge=0, le=65535)] = 0
    """TCP port of the router on the loopback interface; 7447 is the one ROS nodes look for.

    0 takes any free port; a router in a container then publishes no port."""
    listen: ListenAddress | None = None
    """Address at which simulations of other machines can join (`throwcollect join-run`), such as `tcp/0.0.0.0:7447`;
    they need the token of the run. Null: this machine alone."""
    open: bool = False
    """Any program that reaches the router may join, read and disturb the run; episodes are still signed."""
    ros: Literal["auto", "rclpy", "embedded"] = "auto"
    """What nodes run on: genuine ROS 2 (`rclpy`) or the embedded client; `auto` takes rclpy where it is installed."""
    root_namespace: bool = False
    """The one simulation lives in the root namespace, where nodes look for the real robot (`/clock`, `/tf`,
    `/arm_left_controller/...`), and not in `/sim_0`."""
    domain_id: Annotated[int, Field(ge=0, le=232)] = 0
    """ROS domain."""
    trial_timeout_s: PositiveFloat = 60.0
    """Real time after which a simulation that is still at the same trial is started again; if it still answers, all
    trials have twice the time from then on. It comes on top of the real time that `sim.max_trial_s` takes at real-time
    speed, or in slow motion (`sim.real_time_factor`)."""
    start_timeout_s: PositiveFloat = 60.0
    """Real time within which the first simulation must be ready once it runs."""
    grace_s: Annotated[float, Field(ge=0, le=3600)] = 8.0
    """Real time that running trials have left after Ctrl-C or SIGTERM; `throwcollect resume` runs those that did not
    end."""
    retries: Annotated[int, Field(ge=0, le=100)] = 3
    """How often a trial is tried again, by another simulation if there is one, before it is recorded as `lost`. A try
    of a simulation that is alive, and only slow or cut off for a while, does not count."""
    replay: Annotated[int, Field(ge=0)] = 3
    """How many trials, chosen by the seed, a fresh process simulates again at the end, to be compared bit for bit."""
    restarts: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often one simulation is restarted before the run goes on without it."""

    def _find_contradictions(self) -> Iterator[tuple[str, str]]:
        if self.listen is None and self.simulations == 0:
            yield "simulations", "should be 1 or more, as no other machine can join (run.listen), got 0"
        if self.listen is not None and self.open:
            yield "open", "should be false, as other machines can reach the run (run.listen)"
        if self.listen is not None and self.runtime not in ("auto", "local"):
            yield "runtime", f"should be local, as other machines are to join (run.listen), got {self.runtime}"


Size = Annotated[str, Field(pattern=r"^[1-9][0-9]{0,17}[bkmg]?$")]
Cores = Annotated[str, Field(pattern=r"^[0-9]+(-[0-9]+)?(,[0-9]+(-[0-9]+)?)*$")]
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


_TIME = r"^([0-9]+|[0-9]+:[0-9]{1,2}(:[0-9]{1,2})?|[0-9]+-[0-9]{1,2}(:[0-9]{1,2}){0,2})$"
Time = Annotated[str, Field(pattern=_TIME)]
Memory = Annotated[str, Field(pattern=r"^[1-9][0-9]*[KMGT]$")]
Word = Annotated[str, Field(pattern=r"^[!-~]+$")]
Line = Annotated[str, Field(pattern=r"^[^\p{Cc}\p{Zl}\p{Zp}]*$")]
Scratch = Annotated[str, Field(pattern=r"^[/$][A-Za-z0-9_./${}-]*$")]
Bind = Annotated[Line, Field(pattern=r"^/[^:,]*(:/[^:,]*(:r[ow])?)?$")]


class ClusterConfig(Section):
    """How a collection is run as an array of tasks of a scheduler; nothing in this section changes the dataset."""

    partition: Word | None = None
    """Partition that the tasks are queued in; null leaves the choice to the scheduler, here and in the next keys."""
    account: Word | None = None
    """Account that is charged."""
    qos: Word | None = None
    """Quality of service."""
    constraint: Word | None = None
    """Features that a node must have."""
    time: Time | None = None
    """Time limit of a task, such as `4:00:00`; shortly before it, the task shuts down properly, and is queued again
    (`requeue`)."""
    memory: Memory | None = None
    """Memory of a task, such as `4G`."""
    cores: Annotated[int, Field(ge=1, le=256)] = 1
    """Cores of a task, which runs one simulation on each."""
    at_once: PositiveInt | None = None
    """Largest number of tasks that run at the same time."""
    modules: list[Word] = []
    """Environment modules that a task loads."""
    lines: list[Line] = []
    """Further lines that the site needs at the start of the batch script: `#SBATCH` options and commands."""
    image: str | None = None
    """Image of Apptainer that tasks run in (`make sif`); null takes the Python environment from which
    the collection is submitted, which all nodes have to see."""
    binds: list[Bind] = []
    """Further directories that tasks see inside the image, as DIRECTORY[:INSIDE[:ro]]; they always see the directory of
    the dataset."""
    scratch: Scratch | None = None
    """Directory on a disk of the node, such as `$TMPDIR`, in which a task collects before it hands its slice over."""
    requeue: Annotated[int, Field(ge=0, le=1000)] = 10
    """How often a task that was stopped, and has shut down properly, is queued again."""
