"""`throwcollect coordinator`: where nobody has prepared the dataset, it does so itself."""

from __future__ import annotations

import sys
from pathlib import Path

from throwcollect.cli.dataset import describe
from throwcollect.config.loader import loaded
from throwcollect.coordinator.main import run
from throwcollect.coordinator.prepare import more_trials, prepare
from throwcollect.coordinator.resume import begun, resume
from throwcollect.dataset.inspect import info
from throwcollect.wording import counted


def coordinate(directory: Path, *, config: Path | None) -> None:
    """Collect into a directory.

    Args:
        directory: Directory of the dataset: prepared, or also a new one if a configuration is given.
        config: YAML file of the collection, of which the plan is made first, unless it is there; the summary is
            printed at the end.

    Raises:
        ConfigError: If the configuration, the sweep or the directory cannot be used.
        DatasetError: If the directory holds no plan, or cannot be written.
        Interrupted: If a signal ended the collection before its last trial.
    """
    if config is None:
        run(directory)
        return
    freeze = resume if begun(directory) else prepare
    with loaded(config) as read:
        plan = freeze(read, directory, sweep_directory=config.parent)
    print(f"plan: {counted(len(plan.trials), 'trial')}{more_trials(plan)}; dataset: {directory}", flush=True)
    run(directory)
    sys.stdout.write(describe(info(directory).as_dict()))
