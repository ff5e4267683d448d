"""All commands of the command line. Each of them imports what it needs when it is called, so that all start fast."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import typer

from throwcollect.cli import cluster_commands, collect, image_commands, learning, node_commands, runs, serve, show
from throwcollect.cli.dataset import derive, info, replay, verify_command, writing
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
dataset_app = typer.Typer(help="Look into datasets, and make others from them.", no_args_is_help=True)
image_app = typer.Typer(help="Make the image that containers are made from.", no_args_is_help=True)
app.add_typer(dataset_app, name="dataset")
app.add_typer(image_app, name="image")
app.add_typer(ros_app, name="ros")


def _add(*commands: Callable[..., None], panel: str | None = None, hidden: bool = False) -> None:
    for command in commands:
        app.command(rich_help_panel=panel, hidden=hidden)(command)


_add(show.init, collect.up, collect.resume, collect.cover, collect.join_run, cluster_commands.submit, collect.join)
_add(runs.ps, runs.wait, runs.logs, runs.events, runs.scale, runs.stop, runs.down, panel="Runs")
_add(serve.serve, serve.view, panel="Runs")
_add(learning.fit, learning.aim, learning.throw, learning.score, learning.adapt, panel="From a dataset to a throw")
_add(show.config, show.plan, show.doctor)
_add(
    node_commands.router,
    node_commands.sim,
    node_commands.coordinator,
    node_commands.health,
    panel="Nodes, as `up` starts them",
)
_add(collect.launch, collect.begin, hidden=True)
image_app.command("build")(image_commands.build)
image_app.command("sif")(image_commands.sif)
dataset_app.command("info")(info.show_info)
dataset_app.command("verify")(verify_command.verify_dataset)
dataset_app.command("digest")(info.show_digest)
dataset_app.command("export")(writing.export_dataset)
dataset_app.command("merge")(derive.merge_datasets)
dataset_app.command("filter")(derive.filter_dataset)
dataset_app.command("sample")(derive.sample_dataset)
dataset_app.command("split")(derive.split_dataset)
dataset_app.command("stats")(derive.show_statistics)
dataset_app.command("report")(writing.report_dataset)
dataset_app.command("view")(writing.view_dataset)
dataset_app.command("render")(writing.render_dataset)
dataset_app.command("replay")(replay.replay_dataset)


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


def main() -> None:
    """Run the command that the command line asks for, and exit with its code."""
    execute(typer.main.get_command(app))
