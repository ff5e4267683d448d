"""How a command of `throwcollect ros` finds the run that it is to join."""

from __future__ import annotations

from throwcollect.errors import WorkerError
from throwcollect.ros.connection import Connection
from throwcollect.runs.records import Records, Run
from throwcollect.runs.run_selection import find_run_to_change, require_living


def find_run_and_connection(run: str | None) -> tuple[Run, Connection]:
    """Find a run, or the only one that lives, and the connection by which our own processes join it.

    Raises:
        ConfigError: If there is no such run, or it has ended.
        WorkerError: If the run has no router (any more).
    """
    found = find_run_to_change(Records(), run, command="ros env")
    record = require_living(found)
    if record.endpoint is None:
        raise WorkerError(f"run {record.run} has no router yet", hint="try once more")
    return found, Connection(record.endpoint, found.key, record.domain_id, record.middleware.joining)
