"""The commands for runs, applied to a dataset that was submitted to a cluster: `wait`, `logs`, `events`, `stop`, `ps`.

They do the same as for runs of this machine, as far as the queue and the files of the dataset allow.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer

from throwcollect.cli.dataset.info import print_collected
from throwcollect.cli.printing import Display, tell
from throwcollect.cli.streams import has_reader
from throwcollect.collect.cluster.cluster_run import ClusterRun, ProgressOfSlices, SlicesState, follow
from throwcollect.collect.runtimes.node_logs import Tail
from throwcollect.dataset.inspect import info
from throwcollect.errors import ConfigError, Interrupted, ThrowcollectError
from throwcollect.own_process import count_interruptions
from throwcollect.wording import command, format_count


def follow_to_the_end(directory: Path, *, as_json: bool) -> None:
    """Show the progress of a run until it ends, and then its summary; Ctrl-C leaves the run alone."""
    run = ClusterRun.open(directory)
    progress = ProgressOfSlices(run)
    with Display(quiet=as_json) as shown, count_interruptions() as interruptions:
        for look in follow(run, keep_on=lambda: not interruptions()):
            shown.update(progress.at(look))
    if look.lives and not look.complete:
        raise Interrupted(f"left; {directory} goes on", hint=command("wait", "--run", directory))
    if (error := run.explain(look)) is not None:
        raise error
    print_collected(info(directory), directory, as_json=as_json)


def print_logs(run: ClusterRun, tasks: list[str], *, until_end: bool = False) -> None:
    """Print the logs of tasks; of all tasks if none is named. With `until_end`, go on until the run ends."""
    numbers = [*map(str, range(run.submission.tasks))]
    for text in tasks:
        if text not in numbers:
            raise ConfigError(f"{run.directory}: has no task {text!r}", expected=f"0 to {numbers[-1]}")
    tails: dict[Path, Tail] = {}

    def print_new(*, last: bool) -> None:
        for text, path in run.logs.items():
            if not tasks or text in tasks:
                for line in tails.setdefault(path, Tail(path)).lines(torn=last):
                    typer.echo(f"{text:>{len(str(len(numbers)))}} | {line}")

    for _ in follow(run, keep_on=has_reader) if until_end else ():
        print_new(last=False)
    # The tasks may have printed since the last look.
    print_new(last=True)


def print_events(run: ClusterRun, *, as_json: bool) -> None:
    """Print each change of the state of a task, until the run ends; as JSON, one document a line."""

    def print_event(line: str, **document: object) -> None:
        typer.echo(json.dumps(document) if as_json else line)

    before: dict[int | None, str] = {}
    for look in follow(run, keep_on=has_reader):
        states = {task.index: f"{task.state.lower()}{f' on {task.node}' if task.node else ''}" for task in look.tasks}
        for index in sorted(states.keys() | before.keys(), key=lambda each: each or 0):
            now = states.get(index, "ended")
            # Slurm forgets a task some minutes after its end, which is no event if the end was printed.
            if before.get(index) != now and (index in states or before.get(index) != "ended"):
                who = "all tasks" if index is None else f"task {index}"
                print_event(f"{who}: {now}", event="task", task=index, state=now)
            before[index] = now
    last = "finished" if look.complete else "over"
    print_event(last, event=last)


def end(run: ClusterRun) -> None:
    """Ask all jobs of a run to end, and wait until they have."""
    run.stop()
    for look in follow(run):
        last = look
    complete = "is complete" if last.complete else "is not complete"
    typer.echo(f"{run.directory}: stopped; the dataset {complete}")


def list_queued(directories: Iterable[Path]) -> list[tuple[ClusterRun, SlicesState]]:
    """List the runs in the queue, and how each is; print the error of one whose directory is gone, for example."""
    found = []
    for directory in directories:
        try:
            run = ClusterRun.open(directory)
            found.append((run, run.look()))
        except ThrowcollectError as error:
            tell(f"throwcollect: {error}")
    return found


def make_row(run: ClusterRun, look: SlicesState) -> tuple[str, ...]:
    """Make the row of a run in the table that `ps` prints."""
    return (
        _number_of(run),
        "slurm",
        str(look.running * run.simulations_per_task),
        f"{ProgressOfSlices(run).at(look).ended}/{run.trials}",
        _describe_status(look, run),
        str(run.directory),
    )


def make_document(run: ClusterRun, look: SlicesState) -> dict[str, Any]:
    """Make the entry of a run in the JSON document that `ps` prints."""
    return {
        "run": _number_of(run),
        "runtime": "slurm",
        "directory": str(run.directory),
        "tasks": run.submission.tasks,
        "finished": len(look.finished),
        "running": look.running,
        "waiting": look.waiting,
    }


def _number_of(run: ClusterRun) -> str:
    """Find the number of the run's last array, or of its joining job if there was nothing else left to submit."""
    return run.submission.jobs[-1].array or run.submission.jobs[-1].join


def _describe_status(look: SlicesState, run: ClusterRun) -> str:
    if run.submission.live:
        return f"one run on {format_count(run.submission.tasks, 'node')}, {'running' if look.running else 'waiting'}"
    tasks = format_count(run.submission.tasks, "task")
    return f"{len(look.finished)} of {tasks} finished, {look.running} running, {look.waiting} waiting"
