"""Follows a run while it lives: its progress, the logs of its nodes, and its events."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass

from throwcollect.collect.coordinator.progress import Progress
from throwcollect.collect.runs.events import EVENTS, Event, parse
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runs.run_selection import describe_death
from throwcollect.collect.runtimes.node_logs import NodeLogs, Tail
from throwcollect.dataset.summary import Info
from throwcollect.errors import ConfigError
from throwcollect.wording import suggest

_READ_S = 0.2


@dataclass(frozen=True)
class RunUpdate:
    """A run as it was at one moment, and what has happened since the update before.

    Attributes:
        progress: The latest report of the coordinator since the last update; None if there was none.
        events: Events since the last update.
    """

    run: Run
    progress: Progress | None = None
    events: tuple[Event, ...] = ()


def follow(run: Run, *, keep_on: Callable[[], bool] = lambda: True, from_start: bool = False) -> Iterator[RunUpdate]:
    """Look at a run several times a second until it ends, or `keep_on` returns false.

    A program may follow several runs at once. With `from_start`, the first update has the events until now.

    Yields:
        An update; the last one shows a run that has ended or died, unless `keep_on` returned false.
    """
    events = Tail(run.record.logs / EVENTS)
    if not from_start:
        events.skip()
    yield RunUpdate(run, events=_read_new_events(events, run))
    while run.status == "running" and keep_on():
        time.sleep(_READ_S)
        known = run.record.progress
        # The launcher writes events before the record, so the last record is read before the last events.
        run = run.now()
        progress = run.record.progress if run.record.progress != known else None
        yield RunUpdate(run, progress, _read_new_events(events, run))


def wait(run: Run) -> Info:
    """Wait until a run has ended.

    Returns:
        The summary of the dataset; its outcomes show whether trials are lost.
    """
    for update in follow(run):
        run = update.run
    if run.status == "died":
        raise describe_death(run)
    if run.record.summary is None:
        raise run.record.error or describe_death(run)
    return run.record.summary


def read_logs(
    run: Run, nodes: Collection[str], *, until_end: bool, keep_on: Callable[[], bool] = lambda: True
) -> Iterator[tuple[str, str, int]]:
    """Read the logs of these nodes of a run; of all nodes if none is named.

    With `until_end`, this function goes on with new lines until the run ends, or `keep_on` returns false.

    Yields:
        The name of a node, a line that it printed, and the length of the longest name so far.
    """
    files = NodeLogs(run.record.logs).files()
    known = {*files, *(state.name for state in run.record.nodes)}
    if unknown := [node for node in nodes if node not in known]:
        raise ConfigError(f"run {run.id}: no node {unknown[0]!r} has printed anything{suggest(unknown[0], files)}")
    tails: dict[str, Tail] = {}

    def read(now: Run, *, torn: bool) -> Iterator[tuple[str, str, int]]:
        files = NodeLogs(now.record.logs).files()
        width = max(map(len, files), default=0)
        for name, path in files.items():
            if not nodes or name in nodes:
                tail = tails.setdefault(name, Tail(path))
                tail.path = path
                yield from ((name, line, width) for line in tail.lines(torn=torn))

    for update in follow(run, keep_on=keep_on) if until_end else ():
        run = update.run
        yield from read(run, torn=False)
    # Nodes may have printed since the last look.
    yield from read(run, torn=True)


def _read_new_events(tail: Tail, run: Run) -> tuple[Event, ...]:
    """Read the events of a run that were written since the last call."""
    # A run that is begun in the background moves its events and logs to another directory once its plan is made.
    tail.path = run.record.logs / EVENTS
    # If the run resumes a dataset, the file has the events of earlier runs, too.
    return tuple(event for event in filter(None, map(parse, tail.lines())) if event.run == run.id)
