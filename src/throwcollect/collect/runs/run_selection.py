"""Finds the run that a user names, and checks what can be done with it."""

from __future__ import annotations

import os
from pathlib import Path

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.dataset.directory import config_path
from throwcollect.errors import ConfigError, ConflictError, NotFoundError, WorkerError
from throwcollect.files import StrPath
from throwcollect.wording import command, suggest


def find(named: StrPath) -> Run:
    """Find a run of this machine by its id, a unique beginning of its id, or the directory of its dataset."""
    return Records().open(_find_id(Records(), named))


def find_run_to_change(named: str | None, *, died: bool = False) -> Run:
    """Find the run that a command changes; None takes the only run that lives or, with `died`, lost its launcher."""
    if named is not None:
        return find(named)
    statuses = ("running", "died") if died else ("running",)
    living = [run for run in Records().all() if run.status in statuses]
    if len(living) == 1:
        return living[0]
    if living:
        names = ", ".join(run.id for run in living)
        raise ConfigError(f"{len(living)} runs live", expected=names, hint="name one of them with --run")
    raise ConfigError("no run lives", hint="throwcollect up -d starts one; throwcollect ps -a lists earlier ones")


def find_run_to_watch(named: str | None) -> Run:
    """Find the run that a command looks at; None takes the only run that lives or, if none does, the latest run."""
    runs = [] if named is not None else Records().all()
    if runs and not any(run.status == "running" for run in runs):
        return runs[-1]
    return find_run_to_change(named)


def _find_id(records: Records, named: StrPath) -> str:
    """Find the id of the run that a user names by its id, a unique beginning of its id, or its dataset's directory."""
    directory, named = Path(named), os.fspath(named)
    # A variable of a shell that is not set is empty. It would mean the current directory, and every id begins with it.
    if not named:
        raise ConfigError("the name of the run is empty", hint="throwcollect ps -a lists all")
    ids = records.ids()
    # A whole id comes first, because it may also be the beginning of another one.
    if named in ids:
        return named
    if into := records.into(directory):
        return into[-1].id
    matches = [run for run in ids if run.startswith(named)]
    if not matches:
        raise NotFoundError(f"no run {named!r}{suggest(named, ids, 'throwcollect ps -a')}")
    if len(matches) > 1:
        raise ConfigError(f"{len(matches)} runs begin with {named!r}", expected=f"one of {', '.join(matches)}")
    return matches[0]


def refuse_busy(directory: Path, *, own: Run | None = None) -> list[Run]:
    """Refuse a directory into which a run collects, unless it is `own`; return the runs that have collected into it."""
    others = [run for run in Records().into(directory) if own is None or run.id != own.id]
    for run in others:
        if run.status == "running":
            raise ConflictError(
                f"{run.record.directory}: run {run.id} collects into it",
                hint=f"{command('wait', '--run', run.id)} follows it",
            )
    return others


def describe_death(run: Run) -> WorkerError:
    """The error that the launcher of a run died before the run ended."""
    what, hint = f"run {run.id}: its launcher died", f"{command('down', '--run', run.id)} cleans up"
    # A runtime is chosen after the plan is made, so a run with neither has simulated no trial.
    is_planned = run.record.runtime != "" or config_path(run.record.directory).is_file()
    if is_planned and (again := run.record.resume_command):
        what = f"{what}; finished throws are in {run.record.directory}"
        hint = f"{again} goes on where it ended; {hint}"
    return WorkerError(what, evidence=f"the logs are in {run.record.logs}", hint=hint)


def require_living(run: Run) -> RunRecord:
    """Check that a run lives, and return its record."""
    if run.status == "died":
        raise describe_death(run)
    if run.status != "running":
        raise ConflictError(f"run {run.id} has ended", hint="throwcollect ps lists those that live")
    return run.record


def require_simulations(run: Run) -> None:
    """Refuse a run that is a container of the catalogue, as it has no simulations."""
    if run.record.kind == "container":
        raise ConflictError(f"run {run.id}: is a container, and has no simulations")
