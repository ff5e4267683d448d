"""`throwcollect router`, `sim` and `coordinator`: the nodes, as `up` and Compose start them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import ConfigArgument, DatasetArgument
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import LossError


def router(
    listen: Annotated[
        str, typer.Option("--listen", metavar="ENDPOINT", help="Zenoh endpoint to listen on.")
    ] = "tcp/127.0.0.1:7447",
    key: Annotated[
        Path | None,
        typer.Option(
            "--key",
            metavar="DIR",
            help="Key that clients of tls/... need; made if DIR has none. By default, that of THROWCOLLECT_KEY.",
            readable=False,
        ),
    ] = None,
) -> None:
    """Run the router that all nodes connect to."""
    from throwcollect.ros.router import serve

    serve(listen, key)


def sim(
    config: ConfigArgument = DEFAULT_CONFIG,
    name: Annotated[
        str | None, typer.Option("--name", help="Name of the node, and of its namespace; sim_<host name> by default.")
    ] = None,
    namespace: Annotated[
        str | None,
        typer.Option("--namespace", help="Namespace; /<name> by default. / is where nodes of the real robot look."),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="DIR", help="Dataset that clients record into, by the service `record`."),
    ] = None,
) -> None:
    """Run one simulation."""
    from socket import gethostname

    from throwcollect.ros.nodes.simulation.process import run
    from throwcollect.runtimes.nodes import simulation_name_of

    run(config, name=name or simulation_name_of(gethostname()), namespace=namespace, record=record)


def coordinator(
    directory: DatasetArgument,
    config: Annotated[
        Path | None,
        typer.Option("--config", metavar="CONFIG", help="Make the plan of this YAML file first.", readable=False),
    ] = None,
) -> None:
    """Collect into a directory that holds `config.yaml` and `plan.parquet`, or into a new one with --config."""
    from throwcollect.ros.nodes.coordinator.node import run

    if config is None:
        run(directory)
        return
    from throwcollect.cli.dataset.info import describe
    from throwcollect.coordinator.prepare import count_trials
    from throwcollect.coordinator.resume import prepare_or_resume
    from throwcollect.dataset.inspect import info

    plan = prepare_or_resume(config, directory)
    print(f"plan: {count_trials(plan)}; dataset: {directory}", flush=True)
    try:
        # Compose alone looks after the simulations, and does not tell when none can be started.
        run(directory, patience_s=plan.config.run.start_timeout_s)
    except LossError:
        # The dataset is finished even so.
        typer.echo(describe(info(directory)))
        raise
    typer.echo(describe(info(directory)))
