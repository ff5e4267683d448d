"""`throwcollect ros env`: the one line by which any ROS 2 node joins a run."""

from __future__ import annotations

import shlex

import typer

from throwcollect.cli.ros_session import way_into

_RMW = {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}


def show_environment(run: str | None) -> None:
    """Print a line for the shell that has what is started there next join a run; it names files, and no secrets.

    Args:
        run: Id of a run, unique beginning of one, or directory of the dataset; None for the only one that lives.

    Raises:
        ConfigError: If there is no such run, or it has ended.
        WorkerError: If the run has no router (any more).
    """
    variables = {**_RMW, **way_into(run)}
    typer.echo("export " + " ".join(f"{name}={shlex.quote(value)}" for name, value in variables.items()))
