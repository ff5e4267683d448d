"""`throwcollect ros`: a look into the ROS graph with the commands of ROS 2, where there is no ROS 2."""

from __future__ import annotations

from typing import Annotated

import typer

from throwcollect.cli.ros.actions import action_app
from throwcollect.cli.ros.nodes import node_app
from throwcollect.cli.ros.params import param_app
from throwcollect.cli.ros.services import service_app
from throwcollect.cli.ros.topics import topic_app

ros_app = typer.Typer(help="Look into the ROS graph, as the command `ros2` does.", no_args_is_help=True)
ros_app.add_typer(topic_app, name="topic")
ros_app.add_typer(node_app, name="node")
ros_app.add_typer(service_app, name="service")
ros_app.add_typer(action_app, name="action")
ros_app.add_typer(param_app, name="param")


@ros_app.command("env")
def env(
    run: Annotated[
        str | None,
        typer.Option(
            "--run",
            metavar="RUN",
            help="Id of a run, its beginning, or the dataset's directory; by default, the only one.",
        ),
    ] = None,
) -> None:
    """Print the line that lets a shell's ROS 2 nodes join a run: eval "$(throwcollect ros env)"."""
    from throwcollect.cli.ros.env import show_environment

    show_environment(run)
