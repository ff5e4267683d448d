"""`throwcollect ros`: what `ros2` is needed for at a run, for machines without ROS 2."""

from __future__ import annotations

import shlex

import typer

from throwcollect.cli.options import RunOption
from throwcollect.cli.ros.goals import action_app
from throwcollect.cli.ros.graph_session import find_run_and_connection
from throwcollect.cli.ros.parameters import param_app
from throwcollect.cli.ros.topics import topic_app
from throwcollect.files import write_secret

ros_app = typer.Typer(help="Look into the ROS graph, as the command `ros2` does.", no_args_is_help=True)
ros_app.add_typer(topic_app, name="topic")
ros_app.add_typer(action_app, name="action")
ros_app.add_typer(param_app, name="param")

_PROFILE = "fast_dds.xml"


@ros_app.command("env")
def env(run: RunOption = None) -> None:
    """Print the line that lets a shell's ROS 2 nodes join a run: eval "$(throwcollect ros env)"."""
    from throwcollect.ros.fast_dds import PLAIN_DISCOVERY, PROFILE_VARIABLE, client_profile
    from throwcollect.ros.middleware import RMW_VARIABLE

    found, connection = find_run_and_connection(run)
    middleware = found.record.middleware
    # The variables name files and hold no secret, because others may read the environment of a process.
    variables = {**connection.environment(), RMW_VARIABLE: middleware.rmw}
    if middleware.is_fast_dds:
        profile = found.key.directory.parent / _PROFILE
        write_secret(profile, client_profile(connection.endpoint).encode())
        variables |= {PROFILE_VARIABLE: str(profile), **PLAIN_DISCOVERY}
    typer.echo("export " + " ".join(f"{name}={shlex.quote(value)}" for name, value in variables.items()))
