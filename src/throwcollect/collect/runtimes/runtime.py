"""The interface of runtimes, the values that runs and runtimes exchange, and the choice of a runtime by name.

A runtime checks whether it can be used on this machine, and gives each run a host, which simulates the trials from the
start of the run to its end. Hosts that start nodes derive from `nodes.NodeHost`. Other packages may add members of the
family ``runtimes``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol

from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.extras import ENGINE_PACKAGES, MissingExtraError, explain_missing, require_engine
from throwcollect.members import load_member, names_of
from throwcollect.ros.middleware import Middleware, choose_middleware
from throwcollect.wording import suggest

if TYPE_CHECKING:
    from throwcollect.collect.coordinator.progress import Progress
    from throwcollect.collect.coordinator.reporter import Reporter
    from throwcollect.collect.runtimes.nodes import NodeHost
    from throwcollect.collect.runtimes.run_record import NodeState, RunRecord
    from throwcollect.config.schema import Config
    from throwcollect.dataset.summary import Info

AUTOMATIC = ("docker", "local")
"""The runtimes that ``auto`` tries, in this order."""

RunEvent = Literal["started", "scaled", "stopping", "finished", "stopped", "failed"]


@dataclass(frozen=True)
class Check:
    """One finding of `doctor` about the machine, and what follows from it.

    The status is `ok`, `note` (collections run, with a restriction), or `problem` (they do not).
    """

    name: str
    status: Literal["ok", "note", "problem"]
    finding: str


class Session(Protocol):
    """The launcher, as the host of the run sees it: it takes reports, and counts requests to stop."""

    reporter: Reporter

    def update(self, progress: Progress) -> None:
        """Show the user a progress report."""

    def interruptions(self) -> int:
        """How often the user has asked to stop: the first time, running trials are still finished."""

    def event(self, event: RunEvent, *, simulations: int | None = None) -> None:
        """Write an event of the run."""

    def nodes(self, states: Sequence[NodeState], *, endpoint: str | None, simulations: int) -> None:
        """Write the states of the nodes, the endpoint of the router, and how many simulations there are to be."""


class Host(Protocol):
    """Simulates the trials of one run without nodes; see `nodes.NodeHost` for hosts with nodes.

    Attributes:
        cleared: Whether, after `close`, nothing of the run exists any more but its dataset.
    """

    cleared: bool

    def collect(self, session: Session) -> Info:
        """Collect until every trial has ended, finish the dataset, and close; return the summary of the dataset.

        Raises:
            WorkerError: If nodes cannot be started or kept alive.
            DatasetError: If another process changes the dataset, or it cannot be written.
            Interrupted: If the user stopped the collection.
        """

    def close(self) -> None:
        """End everything that still runs, and remove everything that was made for the run but the dataset."""


class Runtime(ABC):
    """A way to simulate trials; the defaults hold for one whose nodes end with their launcher.

    Attributes:
        handle: The kind of id that its nodes have, as a noun.
        outlives_launcher: Whether nodes go on without the process that started them.
        can_be_scaled: Whether a run may have any number of simulations, which can be changed while it lives.
    """

    handle: ClassVar[str] = "pid"
    outlives_launcher: ClassVar[bool] = False
    can_be_scaled: ClassVar[bool] = True

    @abstractmethod
    def describe(self, config: Config) -> str:
        """The runtime in words, as in ``runtime: local processes``."""

    @abstractmethod
    def host(self, record: RunRecord, config: Config, *, warn: Callable[[str], None]) -> Host | NodeHost:
        """Make the host of a run, which starts nothing yet; `warn` gets a line about each long wait.

        Raises:
            ConfigError: If the router's port is taken, or the configuration asks for something that does not exist.
            WorkerError: If this machine does not have the runtime.
        """

    def prepare(self, config: Config, middleware: Middleware, reporter: Reporter) -> Middleware:
        """Make sure that this machine can do a run, even if that takes minutes; `middleware` is that of this process.

        Returns:
            The middleware that will carry the messages of the nodes.

        Raises:
            WorkerError: If the runtime cannot be used.
            ConfigError: If the configuration asks for something that this machine does not have.
            MissingExtraError: If simulations run on this Python, and it lacks the physics engine.
        """
        require_engine(config.sim.engine)
        if config.sim.engine not in ENGINE_PACKAGES:
            # An engine of another package may be broken. Otherwise every simulation would report that, and later.
            load_member("engines", config.sim.engine)
        return middleware

    def check(self) -> Check | None:
        """Examine the runtime for `doctor`; None if there is nothing to report."""
        return None

    def remove(self, run: str) -> list[str]:
        """Remove everything that the runtime holds of a run, but no directory with a dataset.

        A runtime that has ended holds nothing.

        Returns:
            Names of the containers and networks that were removed.

        Raises:
            WorkerError: If the runtime does not answer in time, or something could not be removed; everything else is
                removed first.
        """
        return []


def get_runtime(name: str) -> Runtime:
    """Make the runtime of this name.

    Raises:
        ConfigError: If there is no such runtime.
    """
    if name not in names_of("runtimes"):
        meant = suggest(name, names_of("runtimes"))
        raise ConfigError([Problem(f"there is no runtime {name}{meant}", key="run.runtime")])
    with explain_missing():
        runtime: Runtime = load_member("runtimes", name)()
    return runtime


def find_runtime(name: str) -> Runtime | None:
    """Make the runtime of this name; None if it cannot be used here, as it or a package that it needs is missing.

    This is for runs that are only looked at: other machines, or packages that were removed, may have begun them.
    """
    try:
        return get_runtime(name)
    except (ConfigError, MissingExtraError):
        return None


def choose(config: Config, reporter: Reporter) -> tuple[str, Middleware]:
    """Choose the runtime that a configuration asks for, and make sure that it can be used.

    With ``auto``, nodes are containers if an engine for them is available. rclpy is used where it is installed.

    Returns:
        Name of the runtime, and the middleware that carries the messages of its nodes.
    """
    launcher = choose_middleware(config.run.ros)

    def prepare(name: str, note: str) -> tuple[str, Middleware]:
        runtime = get_runtime(name)
        # A runtime imports the packages that only it needs when it is used.
        with explain_missing():
            middleware = runtime.prepare(config, launcher, reporter)
        rclpy = f" on genuine rclpy with {middleware.rmw}" if middleware.backend == "rclpy" else ""
        reporter.say(f"runtime: {runtime.describe(config)}{rclpy}{note}")
        return name, middleware

    # Simulations of other machines can join a run only if its nodes are processes.
    wanted = config.run.runtime if config.run.listen is None else "local"
    *others, last = candidates = AUTOMATIC if wanted == "auto" else (wanted,)
    note = " (auto)" if candidates == AUTOMATIC else ""
    for name in others:
        try:
            return prepare(name, note)
        except MissingExtraError as error:
            note = f" (auto, as the package {error.package} is not installed)"
        except WorkerError as error:
            note = f" (auto, as {error.message})"
    return prepare(last, note)
