"""The record of one run: its facts, as they are written to a file, and as its host gets them."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, JsonValue

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError, DatasetError, Interrupted, LossError, ThrowcollectError, WorkerError
from throwcollect.ros.middleware import Middleware
from throwcollect.run_key import RunKey
from throwcollect.wording import command

Kind = Literal["collection", "session", "container"]
"""A run collects a dataset, or offers simulations to clients, or is a container of the catalogue."""
Status = Literal["starting", "running", "frozen", "restarting", "lost"]
_EMBEDDED = Middleware()
_KINDS = (ConfigError, WorkerError, DatasetError, LossError, Interrupted)


@dataclass(frozen=True)
class NodeState:
    """The state of one node.

    Attributes:
        status: ``starting`` until a simulation is ready, ``running``, ``frozen``, ``restarting`` (the node ended and
            waits for its next start), or ``lost`` for good.
        restarts: Number of times that the node was started again.
        handle: Process or container id; None if the node does not run.
        last_end: How the node ended last, in words; None if it never did.
    """

    name: str
    status: Status
    restarts: int
    handle: str | None
    last_end: str | None


@dataclass(frozen=True)
class RunFailure:
    """The error that a run ended with, in a form that a record can hold; `errors.ThrowcollectError` has the fields."""

    message: str
    expected: str | None = None
    evidence: str | None = None
    hint: str | None = None

    @classmethod
    def of(cls, error: ThrowcollectError) -> RunFailure:
        """The failure that describes an error."""
        return cls(error.message, error.expected, error.evidence, error.hint)

    def error(self, exit_code: int | None) -> ThrowcollectError:
        """The error as it was raised; the exit code of the run determines its class."""
        kind = next((kind for kind in _KINDS if kind.exit_code == exit_code), ThrowcollectError)
        error = kind(self.message)
        error.expected, error.evidence, error.hint = self.expected, self.evidence, self.hint
        return error


@dataclass(frozen=True)
class Origin:
    """The request of a client of `serve` from which a run was made.

    Attributes:
        component: Name of the component that the run is an instance of.
        simulations: Number of simulations; None takes that of the component's configuration.
        changes: Dotted keys of the component's configuration that the client has changed, with their values.
        joins: Id of the run that a container joins; None if it joins none.
    """

    component: str
    simulations: int | None = None
    changes: dict[str, JsonValue] = field(default_factory=dict)
    joins: str | None = None


@dataclass(frozen=True)
class RunRecord:
    """The record of a run; its launcher changes it, other processes read it.

    Attributes:
        run: Id of the run.
        directory: Directory of the dataset.
        logs: Directory of the logs.
        simulations: Number of simulations that the run is to have.
        middleware: The middleware that carries the messages of the nodes.
        key: The key that the router asks for.
        kind: What the run does.
        name: Name of the collection.
        runtime: Name of the runtime; empty until one is chosen.
        launcher: Process id of the launcher.
        endpoint: Zenoh endpoint at which this machine reaches the router; None while there is no router.
        nodes: The nodes; empty once the run has ended.
        progress: Last report of the coordinator; None before the first one.
        ended: Time of the end; None before.
        exit_code: Exit code of the launcher; None before the end.
        left: Whether containers of the run may still exist, because its launcher did not remove them.
        failure: The error with which the run ended; None if there was none.
        summary: Summary of the dataset; None if the dataset is not finished.
        origin: The request of a client; None if a command or a program began the run.
        stopping: Whether the run was asked to stop; it still finishes the trials that run.
        recordings: Directory into which clients of a session record; None if they cannot.
    """

    # Otherwise the record of another version could be read, with defaults in the place of its fields.
    __pydantic_config__ = ConfigDict(extra="forbid")

    run: str
    directory: Path
    logs: Path
    simulations: int
    middleware: Middleware
    key: RunKey
    kind: Kind = "collection"
    name: str = ""
    runtime: str = ""
    domain_id: int = 0
    started: datetime = field(default_factory=lambda: datetime.now(timezone.utc))
    launcher: int = field(default_factory=os.getpid)
    endpoint: str | None = None
    nodes: tuple[NodeState, ...] = ()
    progress: Progress | None = None
    ended: datetime | None = None
    exit_code: int | None = None
    left: bool = False
    failure: RunFailure | None = None
    summary: Info | None = None
    origin: Origin | None = None
    stopping: bool = False
    recordings: str | None = None

    @property
    def collects(self) -> bool:
        """Whether the run collects a dataset; if not, it goes on until it is stopped."""
        return self.kind == "collection"

    @property
    def resume_command(self) -> str | None:
        """The command that goes on with the dataset once the run is over; None if it collects none."""
        return command("resume", self.directory) if self.collects else None

    @property
    def interruption(self) -> Interrupted:
        """The error that the user stopped the collection before every trial had ended."""
        message = f"interrupted; finished throws are in {self.directory}, the dataset is not complete"
        return Interrupted(message, hint=self.resume_command)

    @property
    def error(self) -> ThrowcollectError | None:
        """The error that the run ended with; None if it finished its dataset."""
        return None if self.exit_code == 0 else (self.failure or RunFailure("")).error(self.exit_code)
