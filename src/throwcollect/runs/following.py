"""What a run tells while it lives: how far it has come, what its nodes print, and what happens to them."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from throwcollect.coordinator.progress import Progress
from throwcollect.errors import ConfigError
from throwcollect.runs.events import EVENTS, Event, parse
from throwcollect.runs.record import Summary
from throwcollect.runs.records import Run
from throwcollect.runs.selection import describe_death
from throwcollect.runtimes.node_logs import NodeLogs, Tail

_POLL_S = 0.05
_READ_S = 0.2


@dataclass(frozen=True)
class Look:
    """What is seen of a run at a time.

    Attributes:
        run: The run, as it is by then.
        progress: How far it has come, if its coordinator has told so since the last look.
        events: What has happened since the last look.
    """

    run: Run
    progress: Progress | None = None
    events: tuple[Event, ...] = ()


def follow(run: Run, *, keep_on: Callable[[], bool] = lambda: True) -> Iterator[Look]:
    """Look at a run until it ends, several times a second; a program may follow several at once.

    Args:
        run: The run.
        keep_on: Asked again and again whether to go on.

    Yields:
        What is seen; at last of a run that has ended or died, unless `keep_on` refused.

    Raises:
        ConfigError: If its record vanishes or cannot be read.
    """
    run.record.middleware.joining.settle()
    from throwcollect.runtimes.run_listener import RunListener

    events = Tail(Path(run.record.logs) / EVENTS)
    events.skip()
    told: list[Progress] = []
    with RunListener(told.append) as listener:
        yield Look(run)
        while run.status == "running" and keep_on():
            told.clear()
            listener.spin(run.connection, _POLL_S)
            run = run.now()
            happened = tuple(event for line in events.lines() if (event := parse(line)))
            yield Look(run, told[-1] if told else None, happened)


def wait(run: Run) -> Summary:
    """Wait until a run has ended.

    Args:
        run: The run.

    Returns:
        What its dataset holds; its outcomes say whether trials are lost.

    Raises:
        WorkerError: If its launcher died.
        ThrowcollectError: What it ended with, if its dataset is not complete.
        ConfigError: If its record vanishes or cannot be read.
    """
    while run.status == "running":
        time.sleep(_READ_S)
        run = run.now()
    if run.status == "died":
        raise describe_death(run)
    if run.record.summary is None:
        raise run.record.error or describe_death(run)
    return run.record.summary


def read_logs(run: Run, nodes: Collection[str], *, follow: bool) -> Iterator[tuple[str, str, int]]:
    """What the nodes of a run have printed, and then print.

    Args:
        run: The run.
        nodes: Names of nodes; all if none.
        follow: Whether to go on until the run ends.

    Yields:
        A line after the name of its node, and the length of the longest name so far.

    Raises:
        ConfigError: If there is no such node, or the record vanishes.
    """
    logs = NodeLogs(Path(run.record.logs))
    files = logs.files()
    known = {*files, *(state.name for state in run.record.nodes)}
    if unknown := [node for node in nodes if node not in known]:
        message = f"run {run.id}: no node {unknown[0]!r} has printed anything"
        raise ConfigError(message, expected=", ".join(files) or None)
    tails: dict[str, Tail] = {}
    for last in _looks(run, follow=follow):
        files = logs.files()
        width = max(map(len, files), default=0)
        for name, path in files.items():
            if not nodes or name in nodes:
                for line in tails.setdefault(name, Tail(path)).lines(torn=last):
                    yield name, line, width


def read_events(run: Run) -> Iterator[tuple[Event, str]]:
    """What happens in a run, from its start until it ends.

    Args:
        run: The run.

    Yields:
        An event, and the line of JSON that it is written as.

    Raises:
        ConfigError: If the record vanishes.
    """
    tail = Tail(Path(run.record.logs) / EVENTS)
    for _ in _looks(run, follow=True):
        for line in tail.lines():
            if (event := parse(line)) is not None:
                yield event, line


def _looks(run: Run, *, follow: bool) -> Iterator[bool]:
    """Again and again, as long as a run lives: False, and True for the last look, which comes after its end."""
    while follow and run.now().status == "running":
        yield False
        time.sleep(_READ_S)
    yield True
