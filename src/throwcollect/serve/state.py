"""The whole state that the server sends to clients: the runs that this machine remembers, and the catalogue."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter
from pydantic.dataclasses import dataclass

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator.resume import is_complete
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_record import Kind, Planning
from throwcollect.collect.runtimes.nodes import is_simulation
from throwcollect.collect.runtimes.runtime import NodeState
from throwcollect.dataset.directory import CONFIG, METADATA
from throwcollect.dataset.summary import Info

Status = Literal["planning", "starting", "running", "ended", "died"]


# These are dataclasses of pydantic, which makes their schema once; for plain ones, it would do so for each route.
@dataclass(frozen=True)
class ComponentState:
    """A component.

    Attributes:
        name: Its name.
        pretty_name: The name that people see.
        kind: Whether its instances collect datasets, have simulations for clients alone, or are containers.
        max_instances: How many instances may live at once.
        instances: Ids of those that live.
    """

    name: str
    pretty_name: str
    kind: Kind
    max_instances: int
    instances: list[str]


@dataclass(frozen=True)
class InstanceState:
    """A run of this machine, whoever began it.

    Attributes:
        component: Name of the component that it is an instance of; None if a command or a program began it.
        kind: Whether it collects a dataset, has simulations for clients alone, or is a container of the catalogue.
        joins: Id of the run that a container has joined; None if it has joined none.
        status: ``planning`` while a large plan is made, ``starting`` until all nodes run, ``running``, ``ended``, or
            ``died`` if its launcher died before the end.
        stopping: Whether it ends because somebody has asked for that; running trials are finished.
        exit_code: Exit code of its launcher; None before it ended.
        message: The error with which it ended, in words; empty if there was none.
        nodes: Its nodes; none once it has ended, or died with them.
        planning: How far the plan is while it is made; else None.
        progress: How far it has come; None before the first report, and without a coordinator.
        dataset: Directory of the dataset; None if it collects none.
        summary: What the dataset holds; None if it is not finished.
        robots: Names of its simulations that run, each of which is the namespace of its topics.
        can_be_resumed: Whether it ended before its last trial, so that clients can continue its dataset.
    """

    id: str
    component: str | None
    name: str
    kind: Kind
    joins: str | None
    status: Status
    started: datetime
    ended: datetime | None
    stopping: bool
    exit_code: int | None
    message: str
    simulations: int
    nodes: list[NodeState]
    planning: Planning | None
    progress: Progress | None
    dataset: str | None
    summary: Info | None
    robots: list[str]
    can_be_resumed: bool


@dataclass(frozen=True)
class WholeState:
    """The state of everything.

    Attributes:
        components: The catalogue.
        instances: Runs of this machine, the latest first: those that live, then the last 100 that are over.
        revision: Grows with each change, as long as the same process serves.
        version: Version of this layout.
    """

    components: list[ComponentState]
    instances: list[InstanceState]
    revision: int = 0
    version: Literal[1] = 1


STATES: TypeAdapter[WholeState] = TypeAdapter(WholeState)


def describe(run: Run, *, is_growing: bool = False) -> InstanceState:
    """Describe a run for clients; ``is_growing`` says that some run collects into its directory."""
    record = run.record
    shared = {name: value for name, value in vars(record).items() if name in InstanceState.__dataclass_fields__}
    own = {
        "id": run.id,
        "component": None if record.origin is None else record.origin.component,
        "joins": None if record.origin is None else record.origin.joins,
        "status": _find_status(run),
        "stopping": record.stopping and run.status == "running",
        "message": str((record.error if record.failure else None) or ""),
        "nodes": list(run.nodes),
        "planning": record.planning if run.status == "running" else None,
        "dataset": record.directory if record.kind == "collection" else None,
        "robots": simulations_of(run.nodes),
        "can_be_resumed": not is_growing and explain_refusal(run) is None,
    }
    return InstanceState(**{**shared, **own})


def explain_refusal(run: Run) -> str | None:
    """Why clients cannot continue the dataset of a run; None if they can. This is cheap enough for many calls."""
    directory = run.context.directory
    if run.status == "running":
        return f"run {run.id} is still running"
    if run.record.kind != "collection" or not os.path.isfile(directory / CONFIG):
        return f"run {run.id} has no dataset in a directory to go on with"
    try:
        changed_ns = directory.stat().st_mtime_ns, (directory / METADATA).stat().st_mtime_ns
    except OSError:
        return None
    return f"the dataset of run {run.id} is complete" if _is_complete(directory, changed_ns) else None


# The tables of a dataset are read again only if files were added, removed or replaced.
@lru_cache(maxsize=1024)
def _is_complete(directory: Path, _changed_ns: tuple[int, int]) -> bool:
    return is_complete(directory)


def simulations_of(nodes: Sequence[NodeState]) -> list[str]:
    """Names of the simulations among the nodes of a run that are running."""
    return [node.name for node in nodes if is_simulation(node.name) and node.status == "running"]


def _find_status(run: Run) -> Status:
    if run.status in ("ended", "abandoned"):
        return "ended"
    if run.status == "died":
        return "died"
    if run.record.planning is not None:
        return "planning"
    nodes = run.record.nodes
    return "running" if nodes and all(node.status != "starting" for node in nodes) else "starting"
