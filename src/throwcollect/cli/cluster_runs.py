"""What commands for runs do with a submitted dataset: the same as with others, as far as a queue knows it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from throwcollect.cluster.following import ClusterRun, Look, ProgressOfSlices, find_queued, follow
from throwcollect.errors import ConfigError, Interrupted
from throwcollect.wording import command, format_count


def follow_to_the_end(directory: Path, *, json: bool) -> None:
    """Show the progress of a run until it is over, and then its summary; Ctrl-C leaves it alone."""
    from throwcollect.cli.dataset.info import print_summary
    from throwcollect.cli.interruptions import Interruptions
    from throwcollect.cli.terminal import display
    from throwcollect.dataset.inspect import info
    from throwcollect.dataset.summary import explain_loss

    run = ClusterRun.open(directory)
    progress = ProgressOfSlices(run)
    with display(quiet=json) as shown, Interruptions() as interruptions:
        for look in follow(run, keep_on=lambda: not interruptions.count):
            shown.update(progress.at(look))
    if look.lives and not look.complete:
        raise Interrupted(f"left; {directory} goes on", hint=command("wait", "--run", directory))
    if (error := run.explain(look)) is not None:
        raise error
    found = info(directory)
    print_summary(found, directory, as_json=json)
    if (lost := explain_loss(found.outcomes, hint=None)) is not None:
        raise lost


def print_logs(run: ClusterRun, tasks: list[str]) -> None:
    """Print what tasks have printed; all if none is named."""
    logs = run.logs
    for text in tasks or logs:
        if not text.isdigit() or int(text) >= run.submission.tasks:
            last = run.submission.tasks - 1
            raise ConfigError(f"{run.directory}: has no task {text!r}", expected=f"0 to {last}")
        if text not in logs:
            raise ConfigError(f"{run.directory}: task {text} has printed nothing yet")
        for line in logs[text].read_text(encoding="utf-8", errors="replace").splitlines():
            typer.echo(f"{text:>{len(str(run.submission.tasks))}} | {line}")


def print_events(run: ClusterRun) -> None:
    """Print what happens to the tasks of a run until it is over."""
    before: dict[int | None, str] = {}
    for look in follow(run):
        states = {task.index: f"{task.state.lower()}{f' on {task.node}' if task.node else ''}" for task in look.tasks}
        for index in sorted(states.keys() | before.keys(), key=lambda each: each or 0):
            now = states.get(index, "ended")
            if before.get(index) != now and (index in states or before.get(index) != "ended"):
                typer.echo(f"task {index}: {now}")
            before[index] = now
    typer.echo("finished" if look.complete else "over")


def end(run: ClusterRun) -> None:
    """End all jobs of a run in order, and wait until they have ended."""
    run.stop()
    for look in follow(run):
        last = look
    complete = "is complete" if last.complete else "is not complete"
    typer.echo(f"{run.directory}: stopped; the dataset {complete}")


def rows() -> Iterator[tuple[str, ...]]:
    """A row of the table of runs for each run in the queue."""
    for run in find_queued():
        look = run.look()
        yield (
            run.submission.jobs[-1].array or run.submission.jobs[-1].join,
            "slurm",
            str(look.running * run.simulations_per_task),
            f"{ProgressOfSlices(run).at(look).ended}/{run.trials}",
            _status(look, run),
            str(run.directory),
        )


def documents() -> list[dict[str, Any]]:
    """The same for JSON."""
    found = []
    for run in find_queued():
        look = run.look()
        found.append(
            {
                "run": run.submission.jobs[-1].array,
                "runtime": "slurm",
                "directory": str(run.directory),
                "tasks": run.submission.tasks,
                "finished": len(look.finished),
                "running": look.running,
                "waiting": look.waiting,
            }
        )
    return found


def _status(look: Look, run: ClusterRun) -> str:
    if run.submission.live:
        return f"one run on {format_count(run.submission.tasks, 'node')}, {'running' if look.running else 'waiting'}"
    tasks = format_count(run.submission.tasks, "task")
    return f"{len(look.finished)} of {tasks} finished, {look.running} running, {look.waiting} waiting"
