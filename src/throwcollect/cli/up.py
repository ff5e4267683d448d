"""`throwcollect up`: from a YAML file to a dataset."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import Any

import typer

from throwcollect.cli.dataset import describe
from throwcollect.cli.interruptions import Interruptions
from throwcollect.cli.terminal import Display, display
from throwcollect.config.loader import load
from throwcollect.coordinator.prepare import prepare
from throwcollect.coordinator.progress import Progress, ProgressListener
from throwcollect.dataset.inspect import info
from throwcollect.errors import DatasetError, Interrupted, WorkerError
from throwcollect.runtime.local import LocalRuntime
from throwcollect.runtime.nodes import NodeExit, node_environment
from throwcollect.runtime.supervisor import Supervisor

_MANY_TRIALS = 1000
"""From here on the plan takes long enough to be announced."""

_POLL_S = 0.05


def collect(path: Path, *, overrides: Sequence[str], output: Path | None, json: bool) -> None:
    """Collect a dataset and print its summary.

    Raises:
        ConfigError: If the configuration, the sweep or the output directory cannot be used.
        WorkerError: If nodes cannot be started or kept alive.
        DatasetError: If the dataset cannot be written.
        Interrupted: If the user stopped the collection.
    """
    started = time.monotonic()
    config = load(path, overrides)
    directory = output or Path("datasets") / f"{config.name}-{datetime.now():%Y%m%d-%H%M%S}"
    with display(quiet=json) as shown:
        runtime = LocalRuntime(directory, directory / "logs", config.run)
        supervisor = Supervisor(runtime, config.run, simulations=config.run.simulations)
        if (config.trials or 0) >= _MANY_TRIALS:
            shown.say(f"plan: checking {config.trials} trials against limits and collisions, about 5 ms each")
        plan = prepare(config, directory, sweep_directory=path.parent)
        if config.run.runtime == "auto":
            shown.say("runtime: local processes (auto)")
        refused = sum(trial.refused is not None for trial in plan.trials)
        note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
        shown.say(f"plan: {len(plan.trials)} trials{note}; dataset: {directory}")
        with Interruptions() as interruptions, supervisor:
            end = _follow(supervisor, config.run.domain_id, shown, interruptions)
    if interruptions.count and (end is None or end.code != 0):
        raise Interrupted(f"interrupted; finished throws are in {directory}, the dataset is not complete")
    if end is not None and end.code != 0:
        kind = DatasetError if end.code == DatasetError.exit_code else WorkerError
        raise kind(f"the coordinator stopped: {end.reason}", evidence=end.log or None)
    summary = {**info(directory).as_dict(), "wall_s": time.monotonic() - started}
    _print_summary(summary, directory, as_json=json)


def _follow(supervisor: Supervisor, domain_id: int, shown: Display, interruptions: Interruptions) -> NodeExit | None:
    """Run until the coordinator ends; how it did, or None when it had to be ended by force."""

    def report(progress: Progress) -> None:
        shown.update(progress)
        supervisor.replace(progress.hung)

    supervisor.start()
    os.environ.update(node_environment(supervisor.runtime.listen, domain_id))
    end = listener = None
    with ExitStack() as stack:
        while end is None and not interruptions.count:
            if listener is not None:
                listener.spin(_POLL_S)
            elif supervisor.router_answers():
                listener = stack.enter_context(ProgressListener(report))
            else:
                time.sleep(_POLL_S)
            end, news = supervisor.poll()
            for line in news:
                shown.warn(line)
        if end is None:
            shown.say("interrupted: finishing the running trials; once more ends at once")
            end = supervisor.drain(hurry=lambda: interruptions.count > 1)
        if listener is not None:
            listener.spin(_POLL_S)
    return end


def _print_summary(summary: dict[str, Any], directory: Path, *, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
        return
    sys.stdout.write(describe(summary))
    typer.echo(f"look into it: throwcollect dataset info {directory}   (or open the .mcap files in Foxglove)")
