"""Commands, options and exit codes; every command's work is done elsewhere and imported when it is called."""

from __future__ import annotations

import os
import sys
import traceback
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

import throwcollect
from throwcollect.errors import ThrowcollectError

app = typer.Typer(
    name="throwcollect",
    help="Collect databases of robot throws from many simulations at once.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
dataset_app = typer.Typer(help="Look into datasets.", no_args_is_help=True)
app.add_typer(dataset_app, name="dataset")


class RuntimeName(str, Enum):
    """Where nodes run."""

    auto = "auto"
    local = "local"


ConfigArgument = Annotated[
    Path, typer.Argument(metavar="CONFIG", help="YAML file of the collection.", show_default=True)
]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Replace a key of the file; may be repeated.")
]
TrialsOption = Annotated[int | None, typer.Option("--trials", metavar="K", min=1, help="Number of trials.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]
DatasetArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the dataset.")]

DEFAULT_CONFIG = Path("throwcollect.yaml")


def _overrides(settings: list[str] | None, trials: int | None) -> list[str]:
    return [*(settings or []), *([f"trials={trials}"] if trials else [])]


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"throwcollect {throwcollect.__version__}")
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
    config: ConfigArgument = DEFAULT_CONFIG,
    simulations: Annotated[int | None, typer.Option("-n", metavar="N", min=1, help="Number of simulations.")] = None,
    settings: SetOption = None,
    runtime: Annotated[RuntimeName | None, typer.Option("--runtime", help="Where the nodes run.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", metavar="DIR", help="Directory of the dataset; must be new or empty.")
    ] = None,
    trials: TrialsOption = None,
    json: JsonOption = False,
) -> None:
    """Collect a dataset: start the simulations, run all trials, write the files."""
    from throwcollect.cli.up import collect

    collect(
        config,
        overrides=_overrides(settings, trials),
        simulations=simulations,
        runtime=runtime.value if runtime else None,
        output=output,
        json=json,
    )


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
        show_config(path, _overrides(settings, None), json=json)


@app.command()
def plan(
    path: ConfigArgument = DEFAULT_CONFIG,
    settings: SetOption = None,
    trials: TrialsOption = None,
    json: JsonOption = False,
) -> None:
    """Print the trials without running them."""
    from throwcollect.cli.show import show_plan

    show_plan(path, _overrides(settings, trials), json=json)


@app.command()
def doctor(json: JsonOption = False) -> None:
    """Check what this machine can do."""
    from throwcollect.cli.show import show_doctor

    show_doctor(json=json)


@dataset_app.command("info")
def dataset_info(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Say what a dataset holds."""
    from throwcollect.cli.dataset import show_info

    show_info(directory, json=json)


@dataset_app.command("verify")
def dataset_verify(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Check a dataset against itself and against physics."""
    from throwcollect.cli.dataset import show_verification

    show_verification(directory, json=json)


@dataset_app.command("digest")
def dataset_digest(directory: DatasetArgument) -> None:
    """Print one hash over all episodes in trial order."""
    from throwcollect.cli.dataset import show_digest

    show_digest(directory)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def router(
    listen: Annotated[
        str, typer.Option("--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on.")
    ] = "tcp/127.0.0.1:7447",
) -> None:
    """Run the router that all nodes connect to."""
    from throwcollect.ros.router import serve

    serve(listen)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def sim(
    config: ConfigArgument = DEFAULT_CONFIG,
    name: Annotated[str, typer.Option("--name", help="Name of the node and of its namespace.")] = "sim_0",
) -> None:
    """Run one simulation."""
    from throwcollect.sim.main import run

    run(config, name=name)


@app.command(rich_help_panel="Nodes, as `up` starts them")
def coordinator(directory: DatasetArgument) -> None:
    """Collect into a directory that holds `config.yaml` and `plan.parquet`."""
    from throwcollect.coordinator.main import run

    run(directory)


def main() -> None:
    """Entry point: run a command, print errors as messages, exit with their codes."""
    try:
        app()
        code = 0
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:
        # Whoever reads our output has left; writing more, at exit, would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except ThrowcollectError as error:
        typer.echo(f"throwcollect: {error}", err=True)
        code = error.exit_code
    except Exception as error:  # noqa: BLE001 - the one place where the unexpected becomes a message
        if os.environ.get("THROWCOLLECT_DEBUG"):
            traceback.print_exc()
        typer.echo(
            f"throwcollect: internal error: {type(error).__name__}: {error}\n"
            "  try: THROWCOLLECT_DEBUG=1 shows where; please report it",
            err=True,
        )
        code = 1
    sys.exit(code)
