"""`throwcollect submit`: submits a collection to Slurm."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer

from throwcollect.cli.options import ConfigArgument, JsonOption, SetOption, TrialsOption, overrides
from throwcollect.cli.printing import print_json, tell
from throwcollect.cli.terminal import display
from throwcollect.wording import command


def submit(
    config: ConfigArgument,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="Directory of the dataset, which all nodes see: new, or with nothing but a plan.",
        ),
    ],
    tasks: Annotated[int, typer.Option("--tasks", metavar="N", min=1, help="Number of tasks; each collects a slice.")],
    settings: SetOption = None,
    trials: TrialsOption = None,
    mode: Annotated[
        Literal["array", "live"],
        typer.Option("--mode", help="array: a task for each slice; live: one run on N nodes, for plans that grow."),
    ] = "array",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the batch script, and do nothing else.")] = False,
    wait: Annotated[bool, typer.Option("--wait", help="Follow it until the dataset is finished.")] = False,
    json: JsonOption = False,
) -> None:
    """Collect a dataset on a cluster: submit an array of tasks to Slurm, and a job that joins what they collect."""
    from throwcollect.cluster.submit import submit as submit_dataset

    changes = overrides(settings, trials=trials)
    shown = display(quiet=json, bar=False)
    done = submit_dataset(config, output, tasks, overrides=changes, live=mode == "live", dry=dry_run, onlooker=shown)
    if done.job is None:
        typer.echo(done.script, nl=False)
        if mode == "array":
            words = [word for change in changes for word in ("--set", change)]
            tell(f"before it is submitted by hand: {command('plan', config, *words, '--output', done.directory)}")
            tell(f"and, as Slurm makes no directory for logs: {shlex.join(['mkdir', '-p', str(done.logs)])}")
            tell(f"after its last task: {command('join', done.directory)}")
    elif wait:
        from throwcollect.cli.cluster_runs import follow_to_the_end

        follow_to_the_end(done.directory, as_json=json)
    elif json:
        print_json({"directory": str(done.directory), "array": done.job.array, "join": done.job.join})
    else:
        tell(f"follow it: {command('wait', '--run', done.directory)}   (or ps, logs, stop)")
