"""What is known of one run."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Literal

from pydantic import JsonValue

from throwcollect.coordinator.progress import Progress
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError, DatasetError, Interrupted, LossError, ThrowcollectError, WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.runtimes.runtime import NodeState, Place

VERSION: Literal[1] = 1
"""Version of the layout of records."""
Kind = Literal["collection", "session", "container"]
"""Whether a run collects a dataset, has simulations for clients alone, or is a container of the catalogue."""
_EMBEDDED = Middleware()
_KINDS = (ConfigError, WorkerError, DatasetError, LossError, Interrupted)


@dataclass(frozen=True)
class Summary(Info):
    """What the dataset of a run holds.

    Attributes:
        open: Whether anybody could join the run.
    """

    open: bool = False


@dataclass(frozen=True)
class Failure:
    """The facts of the error that a run ended with; see `errors.ThrowcollectError`.

    Attributes:
        message: Where and what.
        expected: What would have been right.
        evidence: What was seen.
        hint: What gets further.
    """

    message: str
    expected: str | None = None
    evidence: str | None = None
    hint: str | None = None

    @classmethod
    def of(cls, error: ThrowcollectError) -> Failure:
        """The facts of an error."""
        return cls(error.message, error.expected, error.evidence, error.hint)

    def error(self, exit_code: int | None) -> ThrowcollectError:
        """The error, as it was raised.

        Args:
            exit_code: That of its kind.
        """
        kind = next((each for each in _KINDS if each.exit_code == exit_code), ThrowcollectError)
        error = kind(self.message)
        error.expected, error.evidence, error.hint = self.expected, self.evidence, self.hint
        return error


@dataclass(frozen=True)
class Origin:
    """What a client asked for, of which a run came.

    Attributes:
        component: Name of the component that the run is an instance of.
        simulations: Number of simulations; None for that of the component's configuration.
        changes: Values of dotted keys that replace those of the component's configuration.
        joins: Id of the run that a container joins; None if it joins none.
    """

    component: str
    simulations: int | None = None
    changes: dict[str, JsonValue] = field(default_factory=dict)
    joins: str | None = None


@dataclass(frozen=True)
class Record:
    """What is known of one run.

    Attributes:
        run: Its id.
        name: Name of the collection.
        runtime: Where its nodes live; empty until that is chosen.
        directory: Absolute path of the dataset; if that is in a volume, of the files that it was made from.
        volume: Name of the volume that holds the dataset; None if a directory does.
        logs: Absolute path of the directory of its logs.
        domain_id: ROS domain.
        started: When it was started.
        launcher: Process id of its launcher.
        simulations: Number of simulations that are wanted.
        endpoint: Zenoh endpoint of the router, as this machine reaches it; None while there is none.
        nodes: Its nodes; none once it has ended.
        progress: How far it has come; None before the first report of the coordinator.
        ended: When it ended; None before.
        exit_code: Exit code of its launcher; None before it ended.
        left: Whether containers of it may be left, as its launcher could not remove them or did not come to it.
        failure: The error that it ended with; None if there was none.
        summary: What its dataset holds; None if it is not finished.
        begun_in: Absolute path of the directory in which it was begun; empty if an older version did not note it.
        middleware: What carries the messages of its nodes.
        kind: Whether it collects a dataset, has simulations for clients alone, or is a container of the catalogue.
        origin: What a client asked for; None if a command or a program began the run.
        stopping: Whether it ends because somebody has asked for that; running trials are finished.
        version: Version of this layout.
    """

    run: str
    name: str
    runtime: str
    directory: str
    volume: str | None
    logs: str
    domain_id: int
    started: datetime
    launcher: int
    simulations: int
    endpoint: str | None = None
    nodes: tuple[NodeState, ...] = ()
    progress: Progress | None = None
    ended: datetime | None = None
    exit_code: int | None = None
    left: bool = False
    failure: Failure | None = None
    summary: Summary | None = None
    begun_in: str = ""
    middleware: Middleware = _EMBEDDED
    kind: Kind = "collection"
    origin: Origin | None = None
    stopping: bool = False
    version: Literal[1] = VERSION

    def place(self, key: RunKey) -> Place:
        """Where the run lies.

        Args:
            key: Its key.
        """
        return Place(
            run=self.run,
            directory=Path(self.directory),
            volume=self.volume,
            logs=Path(self.logs),
            simulations=self.simulations,
            middleware=self.middleware,
            key=key,
            collects=self.kind == "collection",
        )

    @property
    def error(self) -> ThrowcollectError | None:
        """The error that the run ended with; None if it finished its dataset."""
        return None if self.exit_code == 0 else (self.failure or Failure("")).error(self.exit_code)
