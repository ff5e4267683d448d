"""`throwcollect up`: from a YAML file to a dataset."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import Any

import typer

from throwcollect.cli.dataset import describe
from throwcollect.cli.terminal import Display, display
from throwcollect.config.loader import load
from throwcollect.coordinator.prepare import prepare
from throwcollect.coordinator.progress import ProgressListener
from throwcollect.dataset.inspect import info
from throwcollect.errors import Interrupted, WorkerError
from throwcollect.runtime.supervisor import Supervisor

_POLL_S = 0.05


def collect(
    path: Path,
    *,
    overrides: Sequence[str],
    simulations: int | None,
    runtime: str | None,
    output: Path | None,
    json: bool,
) -> None:
    """Collect a dataset and print its summary.

    Raises:
        ConfigError: If the configuration, the sweep or the output directory cannot be used.
        WorkerError: If nodes cannot be started or kept alive.
        Interrupted: If the user stopped the collection.
    """
    started = time.monotonic()
    config = load(path, overrides)
    count = simulations or config.run.simulations
    directory = output or Path("datasets") / f"{config.name}-{datetime.now():%Y%m%d-%H%M%S}"
    with display(quiet=json) as shown:
        if (runtime or config.run.runtime) == "auto":
            shown.say("runtime: local processes (auto)")
        plan = prepare(config, directory, sweep_directory=path.parent)
        refused = sum(trial.refused is not None for trial in plan.trials)
        note = f", {refused} refused by calculation (see `throwcollect plan`)" if refused else ""
        shown.say(f"plan: {len(plan.trials)} trials{note}; dataset: {directory}")
        with Supervisor(directory, config.run, simulations=count) as supervisor:
            _follow(supervisor, shown)
    summary = {**info(directory).as_dict(), "wall_s": time.monotonic() - started}
    _print_summary(summary, directory, as_json=json)


def _follow(supervisor: Supervisor, shown: Display) -> None:
    interrupted = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True

    previous = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        supervisor.start()
        os.environ.update(supervisor.environment)
        code = None
        with ProgressListener(shown.update) as progress:
            while code is None and not interrupted:
                progress.spin(_POLL_S)
                code, lost = supervisor.poll()
                for node in lost:
                    shown.say(f"{node.name} was lost ({node.reason}) and is started again")
            if code is None:
                shown.say("interrupted: finishing the running trials")
                code = supervisor.drain()
            progress.spin(_POLL_S)
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    if interrupted:
        raise Interrupted("interrupted; finished throws are on disk, the dataset is not complete")
    if code != 0:
        raise WorkerError(f"the coordinator ended with exit code {code}", evidence=supervisor.coordinator_log() or None)


def _print_summary(summary: dict[str, Any], directory: Path, *, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
        return
    sys.stdout.write(describe(summary))
    typer.echo(f"look into it: throwcollect dataset info {directory}   (or open the .mcap files in Foxglove)")
