"""How a process joins a run: one of ours, or, by `throwcollect ros env`, any ROS 2 node."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import typer

from throwcollect.errors import WorkerError
from throwcollect.files import beside, write_all
from throwcollect.ros.connection import Connection
from throwcollect.ros.fast_dds import PLAIN_DISCOVERY, PROFILE_VARIABLE, client_profile
from throwcollect.ros.middleware import RMW_VARIABLE
from throwcollect.runs.record import Record
from throwcollect.runs.records import Records, Run
from throwcollect.runs.selection import require_living, to_change

_PROFILE = "fast_dds.xml"


@dataclass(frozen=True)
class _Way:
    """What is needed to join a run.

    Attributes:
        run: The run.
        record: Its record.
        endpoint: Endpoint of its router.
    """

    run: Run
    record: Record
    endpoint: str

    @property
    def connection(self) -> Connection:
        """By which a process of ours joins the run."""
        return Connection(self.endpoint, self.run.key, self.record.domain_id, self.record.middleware.joining)


def find_way(run: str | None) -> _Way:
    """The way into a run.

    Args:
        run: Id of a run, unique beginning of one, or directory of the dataset; None for the only one that lives.

    Raises:
        ConfigError: If there is no such run, or it has ended.
        WorkerError: If the run has no router (any more).
    """
    found = to_change(Records(), run, command="ros env")
    record = require_living(found)
    if record.endpoint is None:
        raise WorkerError(f"run {record.run} has no router yet", hint="try once more")
    return _Way(found, record, record.endpoint)


def settle(run: str | None) -> str | None:
    """Have this process use what carries the messages of a run, before it imports anything that depends on it.

    Args:
        run: As `find_way` takes it; None leaves everything to the environment.

    Returns:
        The same.

    Raises:
        ConfigError: If there is no such run, or what carries its messages is not installed.
        WorkerError: If the run has no router (any more).
    """
    if run is not None:
        find_way(run).record.middleware.joining.settle()
    return run


def show_environment(run: str | None) -> None:
    """Print a line for the shell that has what is started there next join a run; it names files, and no secrets.

    Args:
        run: As `find_way` takes it.

    Raises:
        ConfigError: If there is no such run, or it has ended.
        WorkerError: If the run has no router (any more).
    """
    way = find_way(run)
    middleware = way.record.middleware
    variables = {**way.connection.environment(), RMW_VARIABLE: middleware.rmw}
    if middleware.is_fast_dds:
        variables |= {PROFILE_VARIABLE: str(_write_profile(way)), **PLAIN_DISCOVERY}
    typer.echo("export " + " ".join(f"{name}={shlex.quote(value)}" for name, value in variables.items()))


def _write_profile(way: _Way) -> Path:
    """Write the profile that genuine nodes on Fast DDS join by, where the run's key lies."""
    path = way.run.key.directory.parent / _PROFILE
    with beside(path, mode=0o600) as descriptor:
        write_all(descriptor, client_profile(way.endpoint).encode())
    return path
