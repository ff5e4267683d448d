"""`throwcollect router`, `sim`, `sensors` and `coordinator`: the nodes, as `up` and Compose start them."""

from __future__ import annotations

from pathlib import Path

import typer

from throwcollect.cli.options import ConfigArgument, DatasetArgument
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import LossError


def router(*, listen: str = "tcp/127.0.0.1:7447", key: Path | None = None) -> None:
    """Run the router that all nodes connect to.

    Options:
        listen (ENDPOINT): Zenoh endpoint to listen on.
        key (DIR): Key that clients of tls/... need; made if DIR has none. By default, that of THROWCOLLECT_KEY.
    """
    from throwcollect.ros.router import serve

    serve(listen, key)


def sim(
    config: ConfigArgument = DEFAULT_CONFIG,
    *,
    name: str | None = None,
    namespace: str | None = None,
    record: Path | None = None,
) -> None:
    """Run one simulation.

    Options:
        name: Name of the node, and of its namespace; sim_<host name> by default.
        namespace: Namespace; /<name> by default. / is where nodes of the real robot look.
        record (DIR): Dataset that clients record into, by the service `record`.
    """
    from socket import gethostname

    from throwcollect.collect.runtimes.nodes import name_simulation_on
    from throwcollect.ros.nodes.simulation.process import run

    run(config, name=name or name_simulation_on(gethostname()), namespace=namespace, record=record)


def sensors(config: ConfigArgument = DEFAULT_CONFIG, *, namespace: str = "/sim_0") -> None:
    """Publish what the sensors of a configuration see of a running simulation.

    Simulations start this themselves once such a topic has a subscriber.

    Options:
        namespace: Namespace of the simulation.
    """
    from throwcollect.ros.nodes.sensors.node import run

    run(config, namespace=namespace)


def coordinator(directory: DatasetArgument, *, config: Path | None = None) -> None:
    """Collect into a directory that holds `config.yaml` and `plan.parquet`, or into a new one with --config.

    Options:
        config (CONFIG): Make the plan of this YAML file first.
    """
    from throwcollect.collect.coordinator_node.node import run

    if config is None:
        run(directory)
        return
    from throwcollect.cli.dataset.info import describe
    from throwcollect.collect.coordinator.prepare import count_trials
    from throwcollect.collect.coordinator.resume import prepare_or_resume
    from throwcollect.dataset.inspect import info

    plan = prepare_or_resume(config, directory)
    print(f"plan: {count_trials(plan)}; dataset: {directory}", flush=True)
    try:
        # Compose alone looks after the simulations, and does not report when none can be started.
        run(directory, patience_s=plan.config.run.start_timeout_s)
    except LossError:
        # The dataset is finished even so.
        typer.echo(describe(info(directory)))
        raise
    typer.echo(describe(info(directory)))
