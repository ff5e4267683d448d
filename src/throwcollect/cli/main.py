"""Commands and options; every command's work is done elsewhere and imported when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.dataset.commands import DatasetArgument, JsonOption, dataset_app
from throwcollect.cli.execution import execute
from throwcollect.cli.ros.commands import ros_app
from throwcollect.cli.streams import end_with_reader, only_log
from throwcollect.errors import ConfigError
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


ConfigArgument = Annotated[
    # Whether it can be read is found where it is read, and said there.
    Path,
    typer.Argument(metavar="CONFIG", help="YAML file of the collection.", show_default=True, readable=False),
]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Replace a key of the file; may be repeated.")
]
TrialsOption = Annotated[str | None, typer.Option("--trials", metavar="K", help="Number of trials.")]
SimulationsOption = Annotated[
    str | None, typer.Option("-n", metavar="N", help="Number of simulations: run.simulations.")
]
RuntimeOption = Annotated[
    str | None, typer.Option("--runtime", metavar="auto|local|docker", help="Where the nodes run: run.runtime.")
]
DetachOption = Annotated[
    bool, typer.Option("-d", "--detach", help="Print the id of the run as soon as its nodes are started.")
]
RunOption = Annotated[
    str | None,
    typer.Option(
        "--run", metavar="RUN", help="Id of a run, its beginning, or the dataset's directory; by default, the only one."
    ),
]
FollowOption = Annotated[bool, typer.Option("-f", "--follow", help="Go on until the run ends.")]

DEFAULT_CONFIG = Path("throwcollect.yaml")
RUNS = "Runs"


def _overrides(settings: list[str] | None, **options: str | None) -> list[str]:
    """Options for single keys are overrides like any other, and so are their mistakes."""
    named = (f"{key.replace('__', '.')}={value}" for key, value in options.items() if value is not None)
    return [*(settings or []), *named]


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


@app.command()
def up(
    config: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CONFIG]", help="YAML file of the collection; throwcollect.yaml by default.", readable=False
        ),
    ] = None,
    simulations: SimulationsOption = None,
    settings: SetOption = None,
    runtime: RuntimeOption = None,
    output: Annotated[
        Path | None, typer.Option("--output", metavar="DIR", help="Directory of the dataset; must be new or empty.")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option("--resume", metavar="DIR", help="Go on with the dataset in DIR; without CONFIG, with its own."),
    ] = None,
    trials: TrialsOption = None,
    detach: DetachOption = False,
    json: JsonOption = False,
) -> None:
    """Collect a dataset: start the simulations, run all trials, write the files."""
    from throwcollect.cli.up import collect, go_on

    overrides = _overrides(settings, trials=trials, run__simulations=simulations, run__runtime=runtime)
    if resume is None:
        collect(config or DEFAULT_CONFIG, overrides=overrides, output=output, detach=detach, json=json)
    elif output is not None:
        raise ConfigError(f"--output {output}: should be left out with --resume, which names the directory")
    else:
        go_on(resume, path=config, overrides=overrides, detach=detach, json=json)


@app.command("resume")
def resume_(
    directory: DatasetArgument,
    simulations: SimulationsOption = None,
    settings: SetOption = None,
    runtime: RuntimeOption = None,
    trials: TrialsOption = None,
    check: Annotated[
        bool, typer.Option("--check", help="If it is finished, compare every byte of its files, not only their sizes.")
    ] = False,
    detach: DetachOption = False,
    json: JsonOption = False,
) -> None:
    """Go on with a dataset whose collection was ended by anything, or with more trials."""
    from throwcollect.cli.up import go_on

    overrides = _overrides(settings, trials=trials, run__simulations=simulations, run__runtime=runtime)
    go_on(directory, path=None, overrides=overrides, detach=detach, json=json, check=check)


@app.command(rich_help_panel=RUNS)
def ps(
    everything: Annotated[bool, typer.Option("-a", "--all", help="Runs that have ended, too.")] = False,
    json: JsonOption = False,
) -> None:
    """List the runs of this machine, with their nodes."""
    from throwcollect.cli.ps import show_runs

    show_runs(everything=everything, json=json)


@app.command(rich_help_panel=RUNS)
def wait(run: RunOption = None, json: JsonOption = False) -> None:
    """Show the progress of a run until it ends, and then its summary; Ctrl-C leaves it alone."""
    from throwcollect.cli.wait import wait_for

    wait_for(run, json=json)


@app.command(rich_help_panel=RUNS)
def logs(
    nodes: Annotated[list[str] | None, typer.Argument(metavar="[NODE]...", help="Names of nodes; all if none.")] = None,
    follow: FollowOption = False,
    run: RunOption = None,
) -> None:
    """Print what the nodes of a run print."""
    from throwcollect.cli.logs import show_logs

    end_with_reader()
    show_logs(run, nodes or (), follow=follow)


@app.command(rich_help_panel=RUNS)
def events(run: RunOption = None, json: JsonOption = False) -> None:
    """Print what happens in a run, from its start until it ends: nodes started, ready, lost and so on."""
    from throwcollect.cli.logs import show_events

    end_with_reader()
    show_events(run, json=json)


@app.command(rich_help_panel=RUNS)
def scale(
    simulations: Annotated[int, typer.Argument(metavar="N", min=0, max=256, help="Number of simulations.")],
    run: RunOption = None,
) -> None:
    """Change the number of simulations of a run."""
    from throwcollect.cli.control import change_scale

    change_scale(run, simulations)


@app.command(rich_help_panel=RUNS)
def stop(run: RunOption = None) -> None:
    """Finish the running trials of a run, close its files and end it."""
    from throwcollect.cli.control import stop_run

    stop_run(run)


@app.command(rich_help_panel=RUNS)
def down(
    volumes: Annotated[
        bool, typer.Option("-v", "--volumes", help="Remove the volume that holds the dataset, too.")
    ] = False,
    run: RunOption = None,
) -> None:
    """End everything of a run, by force if need be, and forget it; never removes a directory with a dataset."""
    from throwcollect.cli.control import end_run

    end_run(run, volumes=volumes)


@app.command(hidden=True)
def launch(run: str, lock: Annotated[int, typer.Option("--lock", help="Descriptor of the run's locked file.")]) -> None:
    """Launch a prepared run, as `up -d` does."""
    from throwcollect.cli.up import serve

    only_log()
    serve(run, lock)


@app.command()
def config(
    path: ConfigArgument = DEFAULT_CONFIG,
    settings: SetOption = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema instead.")] = False,
    json: JsonOption = False,
) -> None:
    """Print the resolved configuration."""
    from throwcollect.cli.show import show_config, show_schema

    if schema:
        show_schema()
    else:
        show_config(path, _overrides(settings), json=json)


@app.command()
def plan(
    path: ConfigArgument = DEFAULT_CONFIG,
    settings: SetOption = None,
    trials: TrialsOption = None,
    json: JsonOption = False,
) -> None:
    """Print the trials without running them."""
    from throwcollect.cli.show import show_plan

    end_with_reader()
    show_plan(path, _overrides(settings, trials=trials), json=json)


@app.command()
def doctor(json: JsonOption = False) -> None:
    """Check what this machine can do."""
    from throwcollect.cli.show import show_doctor

    show_doctor(json=json)


@image_app.command("build")
def image_build(
    base: Annotated[
        str | None,
        typer.Option("--base", metavar="IMAGE", help="Base image; an official one of Python 3.11 by default."),
    ] = None,
    wheelhouse: Annotated[
        Path | None,
        typer.Option(
            "--wheelhouse",
            metavar="DIR",
            help="Take the wheels from here, not from the package index; docker/wheelhouse.py fills it.",
            readable=False,
        ),
    ] = None,
    tag: Annotated[
        str | None, typer.Option("--tag", metavar="TAG", help="Name of the image; throwcollect:VERSION by default.")
    ] = None,
) -> None:
    """Build the image from a clone of the project."""
    from throwcollect.cli.image import build_image

    build_image(base=base, wheelhouse=wheelhouse, tag=tag)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def router(
    listen: Annotated[
        str, typer.Option("--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on.")
    ] = "tcp/127.0.0.1:7447",
    key: Annotated[
        Path | None,
        typer.Option(
            "--key",
            metavar="DIR",
            help="Key that tls/... lets nobody in without; made if DIR has none. By default, that of THROWCOLLECT_KEY.",
            readable=False,
        ),
    ] = None,
) -> None:
    """Run the router that all nodes connect to."""
    from throwcollect.ros.router import serve

    only_log()
    serve(listen, key)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def sim(
    config: ConfigArgument = DEFAULT_CONFIG,
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the node, and of its namespace; sim_<host name> by default.")
    ] = None,
    namespace: Annotated[
        str | None, typer.Option("--namespace", help="Namespace: / where nodes look that know of no other; /<name>.")
    ] = None,
) -> None:
    """Run one simulation."""
    from socket import gethostname

    from throwcollect.runtime.nodes import simulation_name_of
    from throwcollect.sim.main import run

    only_log()
    run(config, name=name or simulation_name_of(gethostname()), namespace=namespace)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def coordinator(
    directory: DatasetArgument,
    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="CONFIG", help="Make the plan of this YAML file first.", readable=False),
    ] = None,
) -> None:
    """Collect into a directory that holds `config.yaml` and `plan.parquet`, or into a new one with --config."""
    from throwcollect.cli.nodes import coordinate

    only_log()
    coordinate(directory, config=config)


@app.command(hidden=True)
def simulate(directory: DatasetArgument, trials: list[int]) -> None:
    """Simulate trials of a plan and print the digests of their episodes, as a coordinator wants to know them."""
    from throwcollect.cli.nodes import simulate as simulate_trials

    simulate_trials(directory, trials)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def health(
    node: Annotated[
        str | None,
        typer.Argument(
            metavar="NODE",
            help="router, coordinator, or the name of a simulation; by default what THROWCOLLECT_NODE says.",
        ),
    ] = None,
) -> None:
    """Ask a node for a sign of life; exit code 1 if there is none."""
    from throwcollect.ros.health import check

    check(node)


def main() -> None:
    """Run the command that the command line asks for, and exit with its code."""
    execute(app)
