"""What a runtime is.

A runtime says whether it can be had on this machine, and gives a run its host: what has the trials simulated, from the
start of the run to its end. Hosts that start nodes derive from `nodes.NodeHost`. `registry` finds runtimes by name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol

from throwcollect.engine_packages import require_engine
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.wording import command

if TYPE_CHECKING:
    # Records of runs need what is below, and not what takes long to import.
    from throwcollect.config.schema import Config
    from throwcollect.coordinator.progress import Progress
    from throwcollect.dataset.summary import Info

RunEvent = Literal["started", "adopted", "scaled", "stopping", "finished", "stopped", "failed"]
Status = Literal["starting", "running", "frozen", "restarting", "lost"]


@dataclass(frozen=True)
class NodeState:
    """What is known of one node.

    Attributes:
        name: Its name.
        status: ``starting`` until a simulation is ready, ``running``, ``frozen``, ``restarting`` (it ended and waits
            for its next start), or ``lost`` for good.
        restarts: How often it was started again.
        handle: Process or container id; None if it does not run.
        last_end: How it ended last, in words; None if it never did.
    """

    name: str
    status: Status
    restarts: int
    handle: str | None
    last_end: str | None


@dataclass(frozen=True)
class HeldNode:
    """A node of a run that a runtime holds.

    Attributes:
        name: Name of the node.
        status: The runtime's word for its state, such as ``running``, ``paused`` or ``exited``.
        handle: What it is known by there.
    """

    name: str
    status: str
    handle: str


@dataclass(frozen=True)
class HeldRun:
    """A run of which a runtime holds something, whoever started it.

    Attributes:
        run_id: Its id.
        source: Absolute path of the dataset's directory, or name of the volume that holds it.
        version: Version of throwcollect that started it.
        nodes: Its nodes, by name.
    """

    run_id: str
    source: str
    version: str
    nodes: tuple[HeldNode, ...]


@dataclass(frozen=True)
class Place:
    """Where a run lies on this machine, and how its nodes talk.

    Attributes:
        run: Id of the run.
        directory: Directory of the dataset; if that is in a volume, of the files that it is made from.
        volume: Name of the volume that holds the dataset; None if a directory does.
        logs: Directory of its logs.
        simulations: Number of simulations at the start.
        middleware: What carries the messages of its nodes.
        key: What its router lets nobody in without.
        collects: Whether it collects a dataset; if not, its simulations are there for clients, until it is stopped.
    """

    run: str
    directory: Path
    volume: str | None
    logs: Path
    simulations: int
    middleware: Middleware
    key: RunKey
    collects: bool = True

    @property
    def dataset(self) -> str:
        """Where the dataset is, in words."""
        return str(self.directory) if self.volume is None else f"volume {self.volume}, {self.run}"

    @property
    def way_on(self) -> str | None:
        """The command that goes on with the dataset once the run is over; None if there is none, as for a volume."""
        return command("resume", self.directory) if self.collects and not self.volume else None


@dataclass(frozen=True)
class Check:
    """One finding about the machine.

    Attributes:
        name: What was looked at.
        status: `ok`, `note` (collections run, with a restriction), or `problem` (they do not).
        finding: What was found and what follows from it.
    """

    name: str
    status: Literal["ok", "note", "problem"]
    finding: str


class Session(Protocol):
    """A run, as its host sees it: whom to tell what goes on, and who asks for what."""

    def say(self, line: str) -> None:
        """Tell whoever looks on what is good to know."""

    def warn(self, line: str) -> None:
        """Tell whoever looks on what went wrong."""

    def update(self, progress: Progress) -> None:
        """Tell how far the collection has come."""

    def interruptions(self) -> int:
        """How often the user has asked to stop: at first running trials are finished, then no more."""

    def event(self, event: RunEvent, *, simulations: int | None = None) -> None:
        """Write down something that happened to the run."""

    def take_over(self, states: Sequence[NodeState]) -> None:
        """Take over nodes of which a launcher before this one has written."""

    def nodes(self, states: Sequence[NodeState], *, endpoint: str | None, simulations: int) -> None:
        """Write down how the nodes are by now, where the router is, and how many simulations are wanted."""


class Host(Protocol):
    """What has the trials of one run simulated.

    Attributes:
        cleared: Whether nothing of the run is left but the dataset, once it is closed.
    """

    cleared: bool

    def collect(self, session: Session) -> Info | None:
        """Collect until every trial has ended, finish the dataset, and close; or keep simulations until told to stop.

        Returns:
            What the dataset holds; None for a run that collects none.

        Raises:
            WorkerError: If nodes cannot be started or kept alive.
            DatasetError: If another process changes the dataset, or it cannot be written.
            Interrupted: If the user stopped the collection.
        """

    def close(self) -> None:
        """End everything that still runs, and remove all that was made for the run but the dataset."""


class Runtime(ABC):
    """A way to have trials simulated; by default, one of which nothing is left when its launcher has ended.

    Attributes:
        handle: What a node is known by, as a noun.
        outlives_launcher: Whether nodes go on without the process that started them.
        has_volumes: Whether the dataset may be in the volume that ``containers.volume`` names.
        can_be_scaled: Whether the number of simulations can be changed while a run lives.
    """

    handle: ClassVar[str] = "pid"
    outlives_launcher: ClassVar[bool] = False
    has_volumes: ClassVar[bool] = False
    can_be_scaled: ClassVar[bool] = True

    @abstractmethod
    def in_words(self, config: Config) -> str:
        """Where trials are simulated, as in ``runtime: local processes``."""

    @abstractmethod
    def host(self, place: Place, config: Config, *, warn: Callable[[str], None]) -> Host:
        """What is to have the trials of a run simulated, or does so already; nothing is started yet.

        Args:
            place: The run.
            config: Its configuration.
            warn: Is told in one line when something keeps everybody waiting.

        Raises:
            ConfigError: If the router's port is taken, or something that the configuration asks for is not there.
            WorkerError: If there is no such runtime on this machine.
        """

    def begin(self, config: Config, middleware: Middleware) -> None:
        """Begin what takes long and can be begun as soon as the configuration is known, before there is a plan.

        Its end is waited for by the host, and `close` ends what no host needed.

        Args:
            config: The configuration.
            middleware: What this process can join.
        """
        return

    def close(self) -> None:
        """End what `begin` has begun."""
        return

    def is_absent(self) -> bool:
        """Whether it can be seen at a glance that this machine does not have it."""
        return False

    def prepare(
        self, config: Config, middleware: Middleware, *, say: Callable[[str], None], warn: Callable[[str], None]
    ) -> Middleware:
        """Make sure that a run can be had here, however long that takes.

        Args:
            config: Its configuration.
            middleware: What this process can join.
            say: Is told in one line before anything that takes long.
            warn: Is told in one line of what may not be as it should.

        Returns:
            What will carry the messages of its nodes.

        Raises:
            WorkerError: If it cannot be had.
            ConfigError: If the configuration asks for something that is not there.
            MissingExtraError: If simulations run on this Python, and it lacks the physics engine.
        """
        require_engine(config.sim.engine)
        return middleware

    def check(self) -> Check | None:
        """What `doctor` says of it; None if there is nothing to say."""
        return None

    def simulations(self, config: Config) -> int:
        """Number of simulations that a run begins with."""
        return config.run.simulations

    def find_held(self) -> list[HeldRun]:
        """Runs of which there is something here; none if that cannot be found out quickly."""
        return []

    def is_left(self, run: str) -> bool:
        """Whether nodes of a run without a launcher are left here.

        Raises:
            WorkerError: If that cannot be found out in time, and they may be.
        """
        return False

    def remove(self, run: str, *, volumes: bool) -> list[str]:
        """Remove what is left of a run here.

        Args:
            run: Its id.
            volumes: Whether a volume that holds the dataset is removed, too.

        Returns:
            Names of what was removed.

        Raises:
            WorkerError: If something could not be removed, after everything else was.
        """
        return []
