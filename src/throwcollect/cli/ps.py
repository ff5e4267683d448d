"""`throwcollect ps`: the runs of this machine."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

import typer

from throwcollect.errors import ConfigError
from throwcollect.runtime.records import Records, Run
from throwcollect.runtime.runs import on_engine
from throwcollect.runtime.supervisor import NodeState
from throwcollect.wording import counted

if TYPE_CHECKING:
    from throwcollect.runtime.docker_runs import FoundRun

_UNITS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
_HEADINGS = ("RUN", "RUNTIME", "SIMULATIONS", "THROWS", "STATUS", "DATASET")


def show_runs(*, everything: bool, json: bool) -> None:
    """Print the runs that live, that have lost their launcher or, with `everything`, that have ended.

    Raises:
        ConfigError: If the records cannot be used.
    """
    records = Records()
    known: list[Run] = []
    for name in records.ids():
        try:
            known.append(records.get(name))
        except ConfigError as error:
            typer.echo(f"throwcollect: {error}", err=True)
    shown = [run for run in known if everything or run.status != "ended"]
    shown.sort(key=lambda run: run.record.started)
    ids = records.ids()
    held = {found.run_id: found for found in on_engine()}
    strangers = [found for found in held.values() if found.run_id not in ids]
    if json:
        documents = [_document(run) for run in shown] + [_strange_document(found) for found in strangers]
        typer.echo(jsonlib.dumps(documents, indent=2, default=_in_json))
        return
    rows = [(_row(run), _node_lines(run, held.get(run.record.run))) for run in shown]
    rows += [(_strange_row(found), _found_node_lines(found)) for found in strangers]
    for line in _table(rows):
        typer.echo(line)


def _in_json(value: datetime) -> str:
    """A time by RFC 3339, as events have it."""
    return value.isoformat(timespec="milliseconds")


def _document(run: Run) -> dict[str, Any]:
    return {**asdict(run.record), "status": run.status}


def _strange_document(found: FoundRun) -> dict[str, Any]:
    return {"run": found.run_id, "runtime": "docker", "status": "unrecorded", **asdict(found)}


def _row(run: Run) -> tuple[str, ...]:
    record = run.record
    throws = f"{record.trials_ended}/{record.trials}" if record.trials is not None else "-"
    status: str = run.status
    if record.ended is not None:
        status = f"{run.status} {_age(record.ended)} ago, exit code {record.exit_code}"
    elif run.lives:
        status = f"running for {_age(record.started)}"
    return record.run, record.runtime, str(record.simulations), throws, status, record.dataset


def _strange_row(found: FoundRun) -> tuple[str, ...]:
    simulations = sum(node.name.startswith("sim_") for node in found.nodes)
    return found.run_id, "docker", str(simulations), "-", "unrecorded", found.source


def _node_lines(run: Run, found: FoundRun | None) -> list[tuple[str, ...]]:
    if run.status == "running":
        return [_node_line(node, run.record.runtime) for node in run.record.nodes]
    # What a launcher that is gone wrote of its nodes may be true no more.
    return _found_node_lines(found) if found is not None else []


def _node_line(node: NodeState, runtime: str) -> tuple[str, ...]:
    place = "pid" if runtime == "local" else "container"
    again = counted(node.restarts, "restart") if node.restarts else ""
    return (
        node.name,
        node.status,
        f"{place} {node.handle[:12]}" if node.handle else "",
        ", ".join(filter(None, (again, node.last_end and f"last: {node.last_end}"))),
    )


def _found_node_lines(found: FoundRun) -> list[tuple[str, ...]]:
    return [(node.name, node.status, f"container {node.handle[:12]}", "") for node in found.nodes]


def _table(rows: Sequence[tuple[tuple[str, ...], list[tuple[str, ...]]]]) -> Iterable[str]:
    """Runs as one table, and below each run its nodes, indented."""
    runs = _aligned([_HEADINGS, *(run for run, _ in rows)])
    nodes = iter(_aligned([line for _, lines in rows for line in lines]))
    yield runs[0]
    for text, (_, lines) in zip(runs[1:], rows, strict=True):
        yield text
        for _ in lines:
            yield f"  {next(nodes)}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def _age(since: datetime) -> str:
    """A time in its largest unit."""
    seconds = max(0, int((datetime.now(timezone.utc) - since).total_seconds()))
    return next((f"{seconds // size} {unit}" for unit, size in _UNITS if seconds >= size), "0 s")
