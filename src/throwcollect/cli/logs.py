"""`throwcollect logs` and `events`: what nodes say, and what happens to them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import typer

from throwcollect.errors import ConfigError
from throwcollect.runtime.events import EVENTS, parse
from throwcollect.runtime.logs import Tail, log_files
from throwcollect.runtime.records import Record, Records
from throwcollect.runtime.runs import to_watch

_POLL_S = 0.2


def show_logs(named: str | None, nodes: Sequence[str], *, follow: bool) -> None:
    """Print what nodes have printed, each line after the name of its node.

    Raises:
        ConfigError: If there is no such run or no such node.
    """
    records = Records()
    run = to_watch(records, named, say=partial(typer.echo, err=True))
    logs = Path(run.record.logs)
    _check_names(run.record, nodes, log_files(logs))
    tails: dict[str, Tail] = {}
    goes_on = True
    while goes_on:
        # The last look comes after the end.
        goes_on = follow and _runs(records, run.record.run)
        files = log_files(logs)
        width = max(map(len, files), default=0)
        for name, path in files.items():
            if not nodes or name in nodes:
                for line in tails.setdefault(name, Tail(path)).lines(torn=not goes_on):
                    typer.echo(f"{name:{width}} | {line}")
        if goes_on:
            time.sleep(_POLL_S)


def show_events(named: str | None, *, json: bool) -> None:
    """Print what happens in a run, from its start until it ends.

    Raises:
        ConfigError: If there is no such run.
    """
    records = Records()
    run = to_watch(records, named, say=partial(typer.echo, err=True))
    tail = Tail(Path(run.record.logs) / EVENTS)
    goes_on = True
    while goes_on:
        goes_on = _runs(records, run.record.run)
        for line in tail.lines():
            event = parse(line)
            if event is not None:
                typer.echo(line if json else f"{event.time}  {event}")
        if goes_on:
            time.sleep(_POLL_S)


def _runs(records: Records, run: str) -> bool:
    return records.get(run).status == "running"


def _check_names(record: Record, nodes: Sequence[str], files: Mapping[str, Path]) -> None:
    for node in nodes:
        if node not in files and node not in {state.name for state in record.nodes}:
            raise ConfigError(
                f"run {record.run}: no node {node!r} has printed anything",
                expected=", ".join(files) or None,
            )
