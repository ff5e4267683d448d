"""`throwcollect ps`, `wait`, `logs`, `events`, `scale`, `stop` and `down`: watch runs and change them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from throwcollect.cli.options import JsonOption, RunOption
from throwcollect.cli.printing import Display, align, show, tell
from throwcollect.cli.streams import has_reader
from throwcollect.errors import ConfigError, Interrupted
from throwcollect.own_process import count_interruptions
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from throwcollect.collect.cluster.cluster_run import ClusterRun
    from throwcollect.collect.runs.run import Run
    from throwcollect.collect.runtimes.run_record import RunRecord

_UNITS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))
_HEADINGS = ("RUN", "RUNTIME", "SIMULATIONS", "THROWS", "STATUS", "DATASET")


def ps(*, everything: bool = False, json: JsonOption = False) -> None:
    """List the runs of this machine, with their nodes, and the server.

    Options:
        everything (-a --all): Runs that have ended, too.
    """
    from throwcollect.collect.runs.records import Records
    from throwcollect.serve.finding import SERVER, find_server

    records = Records()
    known: list[Run] = []
    for name in records.ids():
        try:
            known.append(records.get(name))
        except ConfigError as error:
            tell(f"throwcollect: {error}")
    shown = [run for run in known if everything or run.status != "ended"]
    shown.sort(key=lambda run: run.record.started)
    server = find_server()
    if json:
        documents = [*map(_make_document, shown)]
        if server is not None:
            documents.append(
                {"run": SERVER, "kind": "server", "status": "running", "url": server.url, "pid": server.pid}
            )
        show(documents, json=True)
        return
    rows = [(_make_row(run), _list_node_lines(run)) for run in shown]
    if server is not None:
        rows.append(((SERVER, "-", "-", "-", f"running at {server.url}, pid {server.pid}", "-"), []))
    for line in _make_table(rows):
        typer.echo(line)


def wait(run: RunOption = None, json: JsonOption = False) -> None:
    """Show the progress of a run until it ends, and then its summary; Ctrl-C leaves it alone."""
    if (submitted := _find_submitted(run)) is not None:
        from throwcollect.cli.cluster_runs import follow_to_the_end

        follow_to_the_end(submitted.directory, as_json=json)
        return
    from throwcollect.cli.dataset.info import print_summary
    from throwcollect.collect.runs.following import follow
    from throwcollect.collect.runs.run_selection import describe_death, find_run_to_watch

    found = find_run_to_watch(run)
    with Display(quiet=json) as shown, count_interruptions() as interruptions:
        for look in follow(found, keep_on=lambda: not interruptions()):
            found = look.run
            if look.progress is not None:
                shown.update(look.progress)
            for event in look.events:
                if event.alarming:
                    shown.warn(str(event))
    record = found.record
    if found.status == "running":
        raise Interrupted(f"left; run {found.id} goes on", hint=command("wait", "--run", found.id))
    if found.status == "died":
        raise describe_death(found)
    if record.summary is not None:
        print_summary(record.summary, record.directory, as_json=json)
    if (error := record.error) is not None:
        raise error


def logs(nodes: list[str] | None = None, *, follow: bool = False, run: RunOption = None) -> None:
    """Print what the nodes of a run print, or the tasks of one on a cluster.

    Options:
        nodes (NODE): Names of nodes; all if none.
        follow (-f --follow): Go on until the run ends.
    """
    if (submitted := _find_submitted(run)) is not None:
        from throwcollect.cli.cluster_runs import print_logs

        print_logs(submitted, nodes or [], until_end=follow)
        return
    from throwcollect.collect.runs.following import read_logs
    from throwcollect.collect.runs.run_selection import find_run_to_watch

    for name, line, width in read_logs(find_run_to_watch(run), nodes or (), until_end=follow, keep_on=has_reader):
        typer.echo(f"{name:{width}} | {line}")


def events(run: RunOption = None, json: JsonOption = False) -> None:
    """Print what happens in a run, from its start until it ends: nodes started, ready, lost and so on."""
    from throwcollect.collect.runs.following import follow
    from throwcollect.collect.runs.run_selection import find_run_to_watch

    for update in follow(find_run_to_watch(run), keep_on=has_reader, from_start=True):
        for event in update.events:
            typer.echo(event.to_json() if json else f"{event.time}  {event}")


def scale(simulations: int, *, run: RunOption = None) -> None:
    """Change the number of simulations of a run.

    Options:
        simulations (N 0..256): Number of simulations.
    """
    from throwcollect.collect.runs import control
    from throwcollect.collect.runs.run_selection import find_run_to_change

    found = find_run_to_change(run)
    control.scale(found, simulations)
    typer.echo(f"{found.id}: {found.record.simulations} -> {format_count(simulations, 'simulation')}")


def stop(run: RunOption = None) -> None:
    """Finish the running trials of a run, close its files and end it; `--run server` ends the server."""
    if _end_elsewhere(run):
        return
    from throwcollect.collect.runs import control
    from throwcollect.collect.runs.run_selection import describe_death, find_run_to_change, require_living

    found = find_run_to_change(run)
    require_living(found)
    collects = found.record.kind == "collection"
    if collects:
        tell(f"{found.id}: finishing the running trials")
    with count_interruptions() as interruptions:
        found = control.stop(found, keep_on=lambda: not interruptions())
    if found.status == "running":
        raise Interrupted(f"left; run {found.id} is still stopping")
    error = describe_death(found) if found.status == "died" else found.record.error
    if error is not None and not isinstance(error, Interrupted):
        raise error
    if not collects:
        typer.echo(f"{found.id}: stopped")
        return
    complete = "is complete" if error is None else "is not complete"
    typer.echo(f"{found.id}: stopped; the dataset {complete}: {found.record.directory}")


def down(*, run: RunOption = None) -> None:
    """End everything of a run, by force if need be, and forget it; never removes a directory with a dataset."""
    if _end_elsewhere(run):
        return
    from throwcollect.collect.runs import control
    from throwcollect.collect.runs.run_selection import find_run_to_change

    found = find_run_to_change(run, died=True)
    for name in control.down(found):
        tell(f"removed {name}")
    typer.echo(f"{found.id}: ended and forgotten")


def _end_elsewhere(named: str | None) -> bool:
    """End a submitted dataset, or the server, if a command names one of them, and no run has that name.

    Returns:
        Whether there was one to end.
    """
    if (submitted := _find_submitted(named)) is not None:
        from throwcollect.cli.cluster_runs import end

        end(submitted)
        return True
    from throwcollect.collect.runs.records import Records
    from throwcollect.serve.finding import SERVER, end_server

    if named != SERVER or named in Records().ids() or (address := end_server()) is None:
        return False
    typer.echo(f"{SERVER}: stopped; it was at {address.url}")
    return True


def _find_submitted(run: str | None) -> ClusterRun | None:
    """Find the submitted dataset whose directory a command names; None if it means a run of this machine."""
    from throwcollect.collect.cluster.submission import is_submitted

    # An empty name would be the path of the current directory.
    if not run or not is_submitted(Path(run)):
        return None
    from throwcollect.collect.cluster.cluster_run import ClusterRun

    return ClusterRun.open(Path(run).absolute())


def _make_document(run: Run) -> dict[str, Any]:
    error = run.record.error if run.record.failure else None
    return {**asdict(run.record), "message": str(error or ""), "status": run.status}


def _make_row(run: Run) -> tuple[str, ...]:
    record = run.record
    throws = f"{record.progress.ended}/{record.progress.total}" if record.progress is not None else "-"
    dataset = str(record.directory) if record.kind == "collection" else "-"
    simulations = "-" if record.kind == "container" else str(record.simulations)
    return run.id, record.runtime, simulations, throws, _describe_status(run, record), dataset


def _describe_status(run: Run, record: RunRecord) -> str:
    if record.ended is not None:
        return f"{run.status} {_format_age(record.ended)} ago, exit code {record.exit_code}"
    if run.lives:
        return f"running for {_format_age(record.started)}"
    return run.status


def _list_node_lines(run: Run) -> list[tuple[str, ...]]:
    """Format the nodes that can still run, as the launcher last wrote them."""
    from throwcollect.collect.runtimes.runtime import Runtime, find_runtime

    handle = (find_runtime(run.record.runtime) or Runtime).handle
    lines: list[tuple[str, ...]] = []
    for node in run.nodes:
        again = format_count(node.restarts, "restart") if node.restarts else ""
        past = ", ".join(filter(None, (again, node.last_end and f"last: {node.last_end}")))
        lines.append((node.name, node.status, f"{handle} {node.handle[:12]}" if node.handle else "", past))
    return lines


def _make_table(rows: Sequence[tuple[tuple[str, ...], list[tuple[str, ...]]]]) -> Iterable[str]:
    """Format runs as one table, with the nodes of each run below it, indented."""
    runs = align([_HEADINGS, *(run for run, _ in rows)])
    nodes = iter(align([line for _, lines in rows for line in lines]))
    yield runs[0]
    for text, (_, lines) in zip(runs[1:], rows, strict=True):
        yield text
        for _ in lines:
            yield f"  {next(nodes)}"


def _format_age(since: datetime) -> str:
    """Write the time since an instant, in its largest unit."""
    seconds = max(0, int((datetime.now(timezone.utc) - since).total_seconds()))
    return next((f"{seconds // size} {unit}" for unit, size in _UNITS if seconds >= size), "0 s")
