"""The commands for runs, applied to a dataset that was submitted to a cluster: `wait`, `logs`, `stop`.

They do the same as for runs of this machine, as far as the queue and the files of the dataset allow.
"""

from __future__ import annotations

from pathlib import Path

import typer

from throwcollect.cli.dataset.info import print_collected
from throwcollect.cli.printing import Display
from throwcollect.cli.streams import has_reader
from throwcollect.collect.cluster.cluster_run import ClusterRun, ProgressOfSlices, follow
from throwcollect.collect.runtimes.node_logs import Tail
from throwcollect.dataset.inspect import info
from throwcollect.errors import ConfigError, Interrupted
from throwcollect.own_process import count_interruptions
from throwcollect.wording import command


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


def end(run: ClusterRun) -> None:
    """Ask all jobs of a run to end, and wait until they have."""
    run.stop()
    for look in follow(run):
        last = look
    complete = "is complete" if last.complete else "is not complete"
    typer.echo(f"{run.directory}: stopped; the dataset {complete}")
