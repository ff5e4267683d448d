"""`throwcollect coordinator`: where nobody has prepared the dataset, it does so itself."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from throwcollect.cli.dataset.info import describe
from throwcollect.config.loader import load, loaded
from throwcollect.coordinator.main import run
from throwcollect.coordinator.prepare import more_trials, prepare
from throwcollect.coordinator.resume import begun, resume
from throwcollect.dataset.directory import CONFIG, PLAN
from throwcollect.dataset.inspect import info
from throwcollect.errors import LossError
from throwcollect.sweep.plan import Plan
from throwcollect.wording import counted


def simulate(directory: Path, trials: Sequence[int]) -> None:
    """Simulate trials of a plan in this process and print the digest of each episode, a JSON document a line.

    Args:
        directory: Directory that holds configuration and plan.
        trials: Their numbers.

    Raises:
        ConfigError: If the configuration is wrong.
        DatasetError: If there is no plan.
        ThrowcollectError: If a trial cannot be simulated.
    """
    from throwcollect.replay.throw import Replayer

    plan = Plan.read(directory / PLAN, load(directory / CONFIG))
    replayer = Replayer(plan.config)
    for trial in trials:
        print(json.dumps({"trial": trial, "digest": replayer.run(plan.trials[trial]).digest}), flush=True)


def coordinate(directory: Path, *, config: Path | None) -> None:
    """Collect into a directory.

    Args:
        directory: Directory of the dataset: prepared, or also a new one if a configuration is given.
        config: YAML file of the collection, of which the plan is made first, unless it is there; the summary is
            printed at the end.

    Raises:
        ConfigError: If the configuration, the sweep or the directory cannot be used.
        DatasetError: If the directory holds no plan, or cannot be written.
        LossError: If trials are lost.
        Interrupted: If a signal ended the collection before its last trial.
    """
    if config is None:
        run(directory)
        return
    freeze = resume if begun(directory) else prepare
    with loaded(config) as read:
        plan = freeze(read, directory, sweep_directory=config.parent)
    print(f"plan: {counted(len(plan.trials), 'trial')}{more_trials(plan)}; dataset: {directory}", flush=True)
    loss: LossError | None = None
    try:
        run(directory)
    except LossError as error:
        loss = error
    sys.stdout.write(describe(info(directory).as_dict()))
    if loss is not None:
        raise loss
