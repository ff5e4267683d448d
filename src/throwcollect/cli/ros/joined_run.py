"""How a command of `throwcollect ros` finds the run that it is to join."""

from __future__ import annotations

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.ros.connection import Connection
from throwcollect.ros_installation import shell_rmws
from throwcollect.runs.records import Records, Run
from throwcollect.runs.run_selection import find_run_to_change, require_living
from throwcollect.wording import join_names


def find_run_and_connection(run: str | None) -> tuple[Run, Connection]:
    """Find a run, or the only one that lives, and the connection by which our own processes join it."""
    found = find_run_to_change(Records(), run, command="ros env")
    record = require_living(found)
    if record.endpoint is None:
        raise WorkerError(f"run {record.run} has no router yet", hint="try once more")
    return found, Connection(record.endpoint, found.key, record.domain_id, record.middleware.joining)


def require_rmw_of_shell(run: Run) -> None:
    """Refuse a run whose RMW the ROS 2 of this shell does not have; nodes would end with an error of rcl."""
    rmw, there = run.record.middleware.rmw, shell_rmws()
    if there and rmw not in there:
        raise ConfigError(
            f"run {run.id} is on {rmw}, and the ROS 2 of this shell has {join_names(there)} alone",
            expected="a run that was begun with this ROS 2, or a ROS 2 with that RMW",
            hint="the commands of docs/ros.md, 'With another RMW than the run'; one of them joins without ROS 2",
        )
