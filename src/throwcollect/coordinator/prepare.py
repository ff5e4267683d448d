"""From a configuration to a frozen plan on disk, before anything runs."""

from __future__ import annotations

from pathlib import Path

from throwcollect.config.schema import Config
from throwcollect.dataset.writer import create
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.robots.feasibility import Feasibility
from throwcollect.sweep.plan import Plan, make_plan
from throwcollect.tasks.trajectory import throw_trajectory


def checked_plan(config: Config, *, directory: Path) -> Plan:
    """Draw all trials and refuse those that the robot cannot do.

    Args:
        config: The configuration.
        directory: Where a relative `sweep.file` is looked for: the directory of the configuration's file.

    Raises:
        ConfigError: If the sweep cannot be drawn, or no trial is left.
    """
    feasibility = Feasibility(config)
    return make_plan(config, check=lambda trial: feasibility.check(trial, throw_trajectory(trial)), directory=directory)


def prepare(config: Config, directory: Path, *, sweep_directory: Path) -> Plan:
    """Freeze the plan: write a dataset directory that holds the resolved configuration and all trials.

    Args:
        config: The configuration.
        directory: Directory of the dataset, new or empty.
        sweep_directory: Where a relative `sweep.file` is looked for.

    Raises:
        ConfigError: If the sweep or the directory cannot be used; nothing is left behind then.
    """
    plan = checked_plan(config, directory=sweep_directory)
    try:
        create(directory, plan)
    except DatasetError as error:
        # Nothing has been started yet, so what is wrong is the choice of the directory.
        raise ConfigError(error.message, hint=error.hint) from error
    return plan
