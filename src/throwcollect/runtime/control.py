"""End a run from another process than its launcher."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress

from throwcollect.errors import ConfigError, ThrowcollectError, WorkerError
from throwcollect.runtime.records import Record, Records, Run
from throwcollect.runtime.runs import id_of, living, on_engine, to_change
from throwcollect.wording import command

_POLL_S = 0.05
_STOP_S = 60.0
"""More than a launcher needs to drain and to end all nodes."""
_GRACE_S = 3.0
_FORCE_S = 10.0


def stop(records: Records, run: Run, *, keep_on: Callable[[], bool]) -> Run:
    """Drain a run: no new trial is started, running ones are finished and written, all nodes end.

    Args:
        records: All runs.
        run: The run.
        keep_on: Asked again and again whether to wait on.

    Returns:
        The run, as it is by then.

    Raises:
        ConfigError: If the run has ended, or its record cannot be read.
        WorkerError: If its launcher died, or does not end.
    """
    record = living(run)
    _signal(records, record, signal.SIGTERM)
    deadline = time.monotonic() + _STOP_S
    while records.lives(record.run) and keep_on():
        if time.monotonic() > deadline:
            raise WorkerError(
                f"run {record.run} has not ended within {_STOP_S:g} s",
                hint=f"{command('down', '--run', record.run)} ends it by force",
            )
        time.sleep(_POLL_S)
    return records.get(record.run)


def down(records: Records, named: str | None, *, volumes: bool) -> tuple[str, list[str]]:
    """End everything of a run, by force if need be, and forget it; a dataset in a directory stays.

    Args:
        records: All runs.
        named: As `to_change` takes it, or the id of a run of which only an engine knows; None for the only one of the
            current directory that lives, or whose launcher died.
        volumes: Whether a volume that holds the dataset is removed, too.

    Returns:
        Id of the run, and names of what was removed from an engine.

    Raises:
        ConfigError: If there is no such run, or more than one.
        WorkerError: If something cannot be ended or removed.
    """
    held = {found.run_id for found in on_engine()}
    # What an engine holds besides may be somebody else's, so that has to be named.
    if named is None:
        run = to_change(records, None, command="down -v" if volumes else "down", died=True).record.run
    else:
        run = named if named in held else id_of(records, named)
    record: Record | None = None
    with suppress(ConfigError):
        record = records.get(run).record
    if record is not None:
        _end_launcher(records, record)
    taken = records.take(run)
    if taken is None:
        raise WorkerError(f"run {run}: its launcher does not end", evidence=f"its pid is {record and record.launcher}")
    in_containers = run in held if record is None else record.runtime == "docker"
    try:
        removed = _remove(run, volumes=volumes) if in_containers else []
    except ThrowcollectError:
        taken.close()
        raise
    taken.forget()
    return run, removed


def _end_launcher(records: Records, record: Record) -> None:
    """End a launcher, and with it the processes that it started: it may drain, is told to hurry, and then killed."""
    for number, patience_s in ((signal.SIGTERM, _GRACE_S), (signal.SIGTERM, _FORCE_S), (signal.SIGKILL, _FORCE_S)):
        _signal(records, record, number)
        deadline = time.monotonic() + patience_s
        while records.lives(record.run) and time.monotonic() < deadline:
            time.sleep(_POLL_S)


def _signal(records: Records, record: Record, number: signal.Signals) -> None:
    """Send a signal to a launcher, but to no process that got its pid later."""
    with suppress(ProcessLookupError):
        process = os.pidfd_open(record.launcher)
        try:
            if records.lives(record.run):
                signal.pidfd_send_signal(process, number)
        finally:
            os.close(process)


def _remove(run: str, *, volumes: bool) -> list[str]:
    from throwcollect.runtime.docker_engine import connect
    from throwcollect.runtime.docker_runs import remove

    return remove(connect(), run, volumes=volumes)
