"""`throwcollect submit`: submits a collection to Slurm."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Literal

import typer

from throwcollect.cli.options import ConfigArgument, JsonOption, SetOption, TrialsOption, overrides
from throwcollect.cli.printing import Display, show, tell
from throwcollect.wording import command


def submit(
    config: ConfigArgument,
    *,
    output: Path,
    tasks: int,
    settings: SetOption = None,
    trials: TrialsOption = None,
    mode: Literal["array", "live"] = "array",
    dry_run: bool = False,
    wait: bool = False,
    json: JsonOption = False,
) -> None:
    """Collect a dataset on a cluster: submit an array of tasks to Slurm, and a job that joins what they collect.

    Options:
        output (--output -o DIR): Directory of the dataset, which all nodes see: new, or with nothing but a plan.
        tasks (N 1..): Number of tasks; each collects a slice.
        mode: array: a task for each slice; live: one run on N nodes, for plans that grow.
        dry_run: Print the batch script, and do nothing else.
        wait: Follow it until the dataset is finished.
    """
    from throwcollect.collect.cluster.submit import submit as submit_dataset

    changes = overrides(settings, trials=trials)
    reporter = Display(quiet=json)
    live = mode == "live"
    done = submit_dataset(config, output, tasks, overrides=changes, live=live, dry=dry_run, reporter=reporter)
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
    else:
        show({"directory": done.directory, "array": done.job.array, "join": done.job.join}, json=json)
        if not json:
            tell(f"follow it: {command('wait', '--run', done.directory)}   (or ps, logs, stop)")
