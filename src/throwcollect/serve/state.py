"""The state that the server sends to clients: the runs that this machine remembers, and the catalogue."""

from __future__ import annotations

import asyncio
import math
import os
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter
from pydantic.dataclasses import dataclass

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.coordinator.resume import is_complete
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.nodes import is_simulation
from throwcollect.collect.runtimes.run_record import Kind, NodeState
from throwcollect.dataset.directory import CONFIG, METADATA
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.catalogue import Catalogue

_LOOK_S = 0.2
_FRESH_S = 0.1
"""Clients that follow the state get one that is not older."""
_MOST_OVER = 100

Status = Literal["starting", "running", "ended", "died"]


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
    """A run of this machine, begun by a client, a command or a program.

    Attributes:
        component: Name of the component that it is an instance of; None if a command or a program began it.
        kind: Whether it collects a dataset, has simulations for clients alone, or is a container of the catalogue.
        joins: Id of the run that a container has joined; None if it has joined none.
        status: ``starting`` until all nodes run, ``running``, ``ended``, or ``died`` if its launcher died before the
            end.
        stopping: Whether it ends because it was asked to; running trials are finished.
        exit_code: Exit code of its launcher; None before it ended.
        message: The error with which it ended, in words; empty if there was none.
        nodes: Its nodes; none once it has ended, or died with them.
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
    """Describe a run for clients; ``is_growing``: whether some run collects into its directory."""
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
        "dataset": str(record.directory) if record.collects else None,
        "robots": simulations_of(run.nodes),
        "can_be_resumed": not is_growing and explain_refusal(run) is None,
    }
    return InstanceState(**{**shared, **own})


def explain_refusal(run: Run) -> str | None:
    """Why clients cannot continue the dataset of a run; None if they can. This is cheap enough for many calls."""
    directory = run.record.directory
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
    nodes = run.record.nodes
    return "running" if nodes and all(node.status != "starting" for node in nodes) else "starting"


class States:
    """Reads the state; the record of a run that has ended is read again only if it was written since."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._ended: dict[tuple[str, int | None], Run] = {}
        self._state = WholeState([], [])
        self._read_at = -math.inf
        self._one_look = asyncio.Lock()

    async def read(self, oldest_s: float = 0.0) -> WholeState:
        """Read the state, or return the last one if it is not older than this [s]."""
        # Only one reads at a time, so that an older state never gets a higher revision than a newer one.
        async with self._one_look:
            if time.monotonic() >= self._read_at + oldest_s:
                state = await asyncio.to_thread(self._look)
                self._read_at = time.monotonic()
                if replace(self._state, revision=0) != state:
                    self._state = replace(state, revision=self._state.revision + 1)
            return self._state

    async def follow(self) -> AsyncIterator[WholeState]:
        """The state as it is, and then after each change; a slow client gets only the latest."""
        revision = 0
        while True:
            # If records cannot be read for a while, such as on a full disk, clients keep the last state.
            with suppress(ThrowcollectError, OSError):
                state = await self.read(_FRESH_S)
                if state.revision != revision:
                    revision = state.revision
                    yield state
            await asyncio.sleep(_LOOK_S)

    def _look(self) -> WholeState:
        """All runs that live, and the latest of those that are over."""
        runs = self._read_runs()
        over = [run for run in runs if run.status != "running"]
        alive = [run for run in runs if run.status == "running"]
        # A dataset that another run continues right now cannot be resumed.
        growing = {run.record.directory for run in alive}
        instances = [describe(run, is_growing=run.record.directory in growing) for run in (*alive, *over[:_MOST_OVER])]
        living = [each for each in instances if each.status not in ("ended", "died")]
        components = [
            ComponentState(
                each.name,
                each.pretty_name,
                each.kind,
                each.max_instances,
                [instance.id for instance in living if instance.component == each.name],
            )
            for each in self._catalogue.components.values()
        ]
        return WholeState(components, instances)

    def _read_runs(self) -> list[Run]:
        records = Records()
        runs, ended = [], {}
        for name in records.ids():
            written = name, records.read_change_ns(name)
            # A record that was removed just now or is damaged is left out; `throwcollect ps` reports damaged ones.
            with suppress(ConfigError):
                run = self._ended[written] if written in self._ended else records.get(name)
                runs.append(run)
                if run.status == "ended":
                    ended[written] = run
        self._ended = ended
        return sorted(runs, key=lambda run: run.record.started, reverse=True)
