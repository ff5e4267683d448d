"""The command line as a whole; every command imports what does its work when it is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from throwcollect.cli import cluster, collect, image, learning, nodes, runs, serve, show, starting
from throwcollect.cli.dataset.commands import dataset_app
from throwcollect.cli.execution import execute
from throwcollect.cli.ros.commands import ros_app
from throwcollect.version import __version__

app = typer.Typer(
    name="throwcollect",
    help="Collect databases of robot throws from many simulations at once.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(dataset_app, name="dataset")
image_app = typer.Typer(help="Make the image that containers are made from.", no_args_is_help=True)
app.add_typer(image_app, name="image")
app.add_typer(ros_app, name="ros")


def _add(*commands: Callable[..., None], panel: str | None = None, hidden: bool = False) -> None:
    for command in commands:
        app.command(rich_help_panel=panel, hidden=hidden)(command)


_add(starting.init, collect.up, collect.resume, collect.join_run, cluster.submit, collect.join)
_add(runs.ps, runs.wait, runs.logs, runs.events, runs.scale, runs.stop, runs.down, panel="Runs")
_add(serve.serve, serve.view, panel="Runs")
_add(learning.fit, learning.aim, learning.throw, learning.score, learning.adapt, panel="From a dataset to a throw")
_add(show.config, show.plan, show.doctor)
_add(nodes.router, nodes.sim, nodes.coordinator, nodes.health, panel="Nodes, as `up` starts them")
_add(collect.launch, collect.begin, nodes.simulate, hidden=True)
image_app.command("build")(image.build)
image_app.command("sif")(image.sif)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"throwcollect {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


command = typer.main.get_command(app)
"""The whole command. Making it takes 50 ms of a processor, which nodes that are forked from a process with it save."""


def main() -> None:
    """Run the command that the command line asks for, and exit with its code."""
    execute(command)
