"""Which run is meant, what it ended with, and what a Docker engine knows of runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.errors import ConfigError, DatasetError, Interrupted, LossError, ThrowcollectError, WorkerError
from throwcollect.runtime.records import Record, Records, Run
from throwcollect.wording import command

if TYPE_CHECKING:
    from throwcollect.runtime.docker_runs import FoundRun

_ENGINE_S = 2.0
_SOCKET = "/var/run/docker.sock"
_MOST_LISTED = 5


def to_change(records: Records, named: str | None, *, command: str, died: bool = False) -> Run:
    """The run that a command is to change.

    Args:
        records: All runs.
        named: Id, unique beginning of one, or directory of the dataset; None for the only one that lives and belongs to
            the current directory: it was begun there, or its dataset lies below.
        command: The command without its option ``--run``, which a message adds.
        died: Whether a run whose launcher died may be meant, too.

    Raises:
        ConfigError: If there is no such run, or more than one, or the only one belongs to another directory.
    """
    if named is not None:
        return records.get(id_of(records, named))
    runs = records.all()
    there = [run for run in runs if run.status == "running" or (died and run.status == "died")]
    here = [run for run in there if _belongs_here(run.record)]
    if not here and len(there) == 1:
        record = there[0].record
        raise ConfigError(
            f"no run of this directory lives; {record.run} {_origin(record)}",
            hint=f"throwcollect {command} --run {record.run}, if that one is meant",
        )
    return _only(here or there, runs)


def to_watch(records: Records, named: str | None, *, say: Callable[[str], object]) -> Run:
    """The run that a command is to look at.

    Args:
        records: All runs.
        named: As `to_change` takes it; None for the only one that lives, or else the latest that has ended, of the
            current directory or, if that has none, of any.
        say: Is told which one is meant if it belongs to another directory.

    Raises:
        ConfigError: If there is no such run, or more than one.
    """
    if named is not None:
        return records.get(id_of(records, named))
    runs = records.all()
    here = [run for run in runs if _belongs_here(run.record)]
    known = here or runs
    living = [run for run in known if run.status == "running"]
    run = known[-1] if known and not living else _only(living, runs)
    if not here:
        say(f"run {run.record.run}, which {_origin(run.record)}")
    return run


def _only(living: Sequence[Run], runs: Sequence[Run]) -> Run:
    if len(living) == 1:
        return living[0]
    if living:
        raise ConfigError(
            f"{len(living)} runs live", expected=_listed(_latest_first(living)), hint="name one of them with --run"
        )
    over = f"; of those that are over, there is {_listed(_latest_first(runs))}" if runs else ""
    raise ConfigError(f"no run lives{over}", hint="throwcollect up -d starts one" if not runs else "name it with --run")


def _belongs_here(record: Record) -> bool:
    """Whether a run was begun in the current directory, or its dataset lies below that."""
    here = os.getcwd()
    dataset = None if record.volume else Path(os.path.realpath(record.directory))
    return record.begun_in == here or (dataset is not None and dataset.is_relative_to(here))


def _origin(record: Record) -> str:
    return f"was begun in {record.begun_in}" if record.begun_in else f"collects into {record.dataset}"


def id_of(records: Records, named: str) -> str:
    """Id of the run that a user names by its id, a unique beginning of that, or the directory of the dataset.

    Raises:
        ConfigError: If there is no such run, or more than one.
    """
    ids = records.ids()
    if named in ids:
        return named
    if into := _into(records, Path(named)):
        return into[0].record.run
    alike = [run for run in ids if run.startswith(named)]
    if len(alike) == 1:
        return alike[0]
    if alike:
        raise ConfigError(f"{len(alike)} runs begin with {named!r}", expected=f"one of {_listed(alike)}")
    known = _listed(_latest_first(records.all()))
    hint = "throwcollect ps -a lists all" if known else None
    raise ConfigError(f"no run {named!r}", expected=f"one of {known}" if known else None, hint=hint)


def _latest_first(runs: Sequence[Run]) -> list[str]:
    return [run.record.run for run in reversed(runs)]


def _listed(runs: Sequence[str]) -> str:
    more = len(runs) - _MOST_LISTED
    return ", ".join(runs[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")


def left_in(records: Records, directory: Path) -> Run | None:
    """The run that has no launcher any more while its nodes are left, and collect or have collected into a directory.

    Args:
        records: All runs.
        directory: Directory of a dataset.

    Raises:
        ConfigError: If a run whose launcher lives collects into it.
        WorkerError: If such a run may be left on an engine that is there, but does not answer in time.
    """
    for run in _into(records, directory):
        if run.status == "running":
            raise busy(run.record)
        if run.status in ("died", "abandoned") and run.record.runtime == "docker" and _left_on_engine(run.record):
            return run
    return None


def _left_on_engine(record: Record) -> bool:
    """Whether an engine holds containers of a run; one that is gone holds none that run.

    Raises:
        WorkerError: If the engine does not answer in time.
    """
    from throwcollect.runtime.docker_engine import connect, timed_out
    from throwcollect.runtime.docker_runs import runs

    try:
        return any(found.nodes for found in runs(connect()) if found.run_id == record.run)
    except WorkerError as error:
        if error.__cause__ is None or not timed_out(error.__cause__):
            return False
        raise WorkerError(
            f"{record.directory}: containers of run {record.run} may still collect into it: {error.message}",
            hint="try again once the Docker engine answers",
        ) from error


def _into(records: Records, directory: Path) -> list[Run]:
    """Runs that collect, or have collected, into a directory; the latest first."""
    path = str(directory.absolute())
    return [run for run in reversed(records.all()) if run.record.volume is None and run.record.directory == path]


def busy(record: Record) -> ConfigError:
    """The error that says that a run collects into a directory."""
    return ConfigError(
        f"{record.directory}: run {record.run} collects into it",
        hint=f"{command('wait', '--run', record.run)} follows it",
    )


def failure(record: Record) -> ThrowcollectError | None:
    """The error that an ended run ended with; None if it finished its dataset."""
    if record.exit_code == 0:
        return None
    kinds = (ConfigError, WorkerError, DatasetError, LossError, Interrupted)
    kind = next((each for each in kinds if each.exit_code == record.exit_code), ThrowcollectError)
    return kind(record.message)


def goes_on(record: Record) -> str | None:
    """The command that goes on with the dataset of a run that is over; None if there is none, as it is in a volume."""
    return None if record.volume else command("resume", record.directory)


def died(record: Record) -> WorkerError:
    """The error that says that the launcher of a run died before the run ended."""
    hint = f"{command('down', '--run', record.run)} cleans up"
    if again := goes_on(record):
        hint = f"{again} goes on where it ended, or with its containers if they live; {hint}"
    return WorkerError(
        f"run {record.run}: its launcher died; finished throws are in {record.dataset}",
        evidence=f"the logs are in {record.logs}",
        hint=hint,
    )


def living(run: Run) -> Record:
    """The record of a run that lives.

    Raises:
        ConfigError: If it has ended.
        WorkerError: If its launcher died.
    """
    if run.status == "died":
        raise died(run.record)
    if run.status != "running":
        raise ConfigError(f"run {run.record.run} has ended", hint="throwcollect ps lists those that live")
    return run.record


def on_engine() -> list[FoundRun]:
    """Runs of which a Docker engine holds something; none if there is no engine that answers quickly."""
    if "DOCKER_HOST" not in os.environ and not Path(_SOCKET).exists():
        return []
    from throwcollect.runtime.docker_engine import connect
    from throwcollect.runtime.docker_runs import runs

    try:
        return runs(connect(timeout_s=_ENGINE_S))
    except WorkerError:
        return []
