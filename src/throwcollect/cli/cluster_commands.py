"""`throwcollect submit`: submits a collection to Slurm."""

from __future__ import annotations

import shlex
from pathlib import Path

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
    dry_run: bool = False,
    wait: bool = False,
    json: JsonOption = False,
) -> None:
    """Collect a dataset on a cluster: submit an array of tasks to Slurm, and a job that joins what they collect.

    Options:
        output (--output -o DIR): Directory of the dataset, which all nodes see: new, or with nothing but a plan.
        tasks (N 1..): Number of tasks; each collects a slice.
        dry_run: Print the batch script, and do nothing else.
        wait: Follow it until the dataset is finished.
    """
    from throwcollect.collect.cluster.submission import CLUSTER, LOGS
    from throwcollect.collect.cluster.submit import submit as submit_dataset

    changes = overrides(settings, trials=trials)
    reporter = Display(quiet=json)
    script, job = submit_dataset(config, output, tasks, overrides=changes, dry=dry_run, reporter=reporter)
    directory = output.absolute()
    if job is None:
        typer.echo(script, nl=False)
        words = [word for change in changes for word in ("--set", change)]
        tell(f"before it is submitted by hand: {command('plan', config, *words, '--output', directory)}")
        tell(
            f"and, as Slurm makes no directory for logs: {shlex.join(['mkdir', '-p', str(directory / CLUSTER / LOGS)])}"
        )
        tell(f"after its last task: {command('join', directory)}")
    elif wait:
        from throwcollect.cli.cluster_runs import follow_to_the_end

        follow_to_the_end(directory, as_json=json)
    else:
        show({"directory": directory, "array": job.array, "join": job.join}, json=json)
        if not json:
            tell(f"follow it: {command('wait', '--run', directory)}   (or logs, stop)")
