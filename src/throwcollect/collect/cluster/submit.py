"""Submits a dataset to Slurm: an array of tasks that each collect a slice, and a job that joins the slices."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from throwcollect.collect.cluster import slurm
from throwcollect.collect.cluster.cluster_run import ClusterRun
from throwcollect.collect.cluster.script import BatchScripts
from throwcollect.collect.cluster.slurm import with_site
from throwcollect.collect.cluster.submission import (
    CLUSTER,
    LOGS,
    Job,
    Submission,
    format_indexes,
    is_submitted,
    read_submission,
    write_submission,
)
from throwcollect.collect.coordinator.prepare import describe_plan, prepare
from throwcollect.collect.coordinator.reporter import Reporter
from throwcollect.collect.coordinator.resume import refuse_changes
from throwcollect.collect.runs.slices import check_sliceable, read_changed_config, read_frozen_config
from throwcollect.collect.runtimes.image_sources import SOURCES_LABEL, UNKNOWN, VERSION_LABEL, are_others
from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.creation import remove_plan
from throwcollect.dataset.directory import PLAN
from throwcollect.errors import ConfigError, Problem, WorkerError
from throwcollect.files import unwritable, write_file
from throwcollect.own_process import make_command
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice
from throwcollect.side_by_side import count_cores
from throwcollect.version import __version__
from throwcollect.wording import command, format_count

_SIF_COMMAND = "make sif"
"""Command that makes the SIF of this version, in a clone of the project."""
_COLLECT, _JOIN = "collect.sh", "join.sh"


def submit(
    config: Path,
    directory: Path,
    tasks: int,
    *,
    overrides: Sequence[str] = (),
    dry: bool = False,
    reporter: Reporter,
) -> tuple[str, Job | None]:
    """Plan a dataset and submit it as an array of tasks.

    Args:
        config: The configuration's file.
        directory: Directory of the dataset: new or empty, or with the plan of this configuration; all nodes see it.
        tasks: Number of slices, each of which is a task.
        overrides: Overrides of keys of the configuration, as ``--set`` takes them.
        dry: Whether to make only the script, and write nothing.
        reporter: Receives what is planned and submitted.

    Returns:
        The script of a task, and what was submitted; None if nothing was.
    """
    directory = directory.absolute()
    with load_locating_errors(config, overrides) as read, ExitStack() as undo:
        complete = read.model_copy(update={"cluster": with_site(read.cluster)})
        check_sliceable(complete)
        if complete.trials is not None:
            Slice(0, tasks).trials_of(complete.trials, trials_per_shard=complete.record.trials_per_shard)
        scripts = _make_scripts(complete, directory)
        slices = tuple(range(tasks))
        if dry:
            return scripts.collect(tasks, format_indexes(slices)), None
        if is_submitted(directory):
            raise ConfigError(
                f"{directory}: was submitted already", hint=f"{command('resume', directory)} submits what is missing"
            )
        made, planned = not directory.exists(), not (directory / PLAN).exists()
        _freeze(complete, directory, config.parent, reporter)
        # Only from here on, because a directory that was refused holds files of another user or program.
        undo.callback(_remove, directory, made=made, planned=planned)
        Plan.read(directory / PLAN, read_frozen_config(directory)).slice_of(Slice(0, tasks))
        image = str(scripts.image) if scripts.image else None
        submitted = _submit(scripts, Submission(tasks, tuple(scripts.program), image), slices, reporter)
        undo.pop_all()
        return submitted


def submit_missing(directory: Path, *, overrides: Sequence[str] = (), reporter: Reporter) -> Job | None:
    """Submit the slices of a dataset that are neither finished nor in the queue.

    Overrides may change only keys that do not change the dataset.

    Returns:
        What was submitted; None if nothing is missing.
    """
    directory = directory.absolute()
    submission = read_submission(directory)
    # Wrong changes are refused even if nothing is left to submit.
    config = read_changed_config(directory, overrides)
    look = ClusterRun(directory, submission).look()
    if look.complete:
        return None
    living = {task.index for task in look.tasks if task.lives}
    missing = tuple(each.index for each in submission.slices if each not in look.finished and each.index not in living)
    if not missing and look.lives:
        return None
    scripts = replace(
        _make_scripts(config, directory),
        # All slices go on with the installation and the image of the first submission; this one may be another.
        program=submission.program,
        image=None if submission.image is None else Path(submission.image),
    )
    return _submit(scripts, submission, missing, reporter)[1]


def _submit(
    scripts: BatchScripts, submission: Submission, slices: tuple[int, ...], reporter: Reporter
) -> tuple[str, Job]:
    """Write the scripts and submit them; without slices, submit only the job that joins what is finished."""
    directory = scripts.directory
    try:
        scripts.logs.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(scripts.logs, error) from error
    with ExitStack() as undo:

        def submit_job(name: str, text: str, *options: str) -> str:
            script = directory / CLUSTER / name
            write_file(script, text.encode())
            job = slurm.submit(script, *options)
            # Until the record names the job, no command finds it again, and a failure removes the files that it needs.
            undo.callback(slurm.cancel, [job])
            return job

        text = scripts.collect(submission.tasks, format_indexes(slices)) if slices else ""
        join = _JOIN, scripts.join()
        if slices:
            array = submit_job(_COLLECT, text)
            # The joining job starts after all tasks, however they end, and reports what is missing then.
            joining = submit_job(*join, f"--dependency=afterany:{array}", "--kill-on-invalid-dep=yes")
            message = f"submitted job {array}: {format_count(len(slices), 'task')}; job {joining} joins their slices"
        else:
            array, joining = "", submit_job(*join)
            message = f"submitted job {joining}, which joins the slices; all of them are finished"
        job = Job(array, joining, slices)
        write_submission(directory, replace(submission, jobs=(*submission.jobs, job)))
        undo.pop_all()
    reporter.say(message)
    return text, job


def _make_scripts(config: Config, directory: Path) -> BatchScripts:
    image = None
    if config.cluster.image is not None:
        image = Path(config.cluster.image).absolute()
        if not image.is_file():
            raise ConfigError(
                [Problem(f"there is no image {image}", key="cluster.image")],
                hint=f"{_SIF_COMMAND}, in a clone of the project, makes one",
            )
        # Many login nodes have no Apptainer, though the nodes of tasks have.
        if shutil.which("apptainer") is not None:
            check_sif(image)
    return BatchScripts(config, directory, directory / CLUSTER / LOGS, tuple(make_command()), image)


def _freeze(config: Config, directory: Path, sweep_directory: Path, reporter: Reporter) -> None:
    """Make the plan of the configuration in the directory, or check that the plan there is the same."""
    if (directory / PLAN).exists():
        refuse_changes(directory, read_changed_config(directory), config)
        reporter.say(f"takes the plan in {directory}")
        return
    plan = prepare(config, directory, sweep_directory=sweep_directory, processes=count_cores(), reporter=reporter)
    reporter.say(f"plan: {describe_plan(plan)}; dataset: {directory}")


def _remove(directory: Path, *, made: bool, planned: bool) -> None:
    """Remove the files of a submission that failed."""
    shutil.rmtree(directory / CLUSTER, ignore_errors=True)
    if planned:
        remove_plan(directory, made=made)


def check_sif(sif: Path) -> None:
    """Make sure that a SIF holds the throwcollect that is installed here, because another may collect other bytes.

    A SIF without labels is accepted.
    """
    labels = _read_labels(sif)
    hint = f"{_SIF_COMMAND}, in a clone of the project, makes one"
    if (version := labels.get(VERSION_LABEL, UNKNOWN)) not in (UNKNOWN, __version__):
        raise ConfigError(f"{sif}: holds throwcollect {version}, and this is {__version__}", hint=hint)
    if are_others(labels.get(SOURCES_LABEL)):
        raise ConfigError(f"{sif}: was made from other sources than these", hint=hint)


def _read_labels(sif: Path) -> dict[str, str]:
    answer = subprocess.run(
        ["apptainer", "--nocolor", "inspect", "--json", sif], capture_output=True, text=True, check=False
    )
    if answer.returncode:
        raise WorkerError(f"{sif}: its labels cannot be read", evidence=answer.stderr.strip() or None)
    labels: dict[str, str] = json.loads(answer.stdout)["data"]["attributes"].get("labels") or {}
    return labels
