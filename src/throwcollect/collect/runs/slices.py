"""Collects one slice of a dataset whose plan is frozen; an array task of a scheduler does so on its machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.collect.coordinator.resume import refuse_changes
from throwcollect.collect.runs.preparation import prepare_run
from throwcollect.config.loader import load_locating_errors
from throwcollect.config.schema import Config
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.creation import create
from throwcollect.dataset.directory import PLAN, config_path
from throwcollect.dataset.slices import (
    find_attempts,
    find_finished,
    make_attempt,
    mark_stopped,
    publish,
    remove_stopped,
    take_recordings,
)
from throwcollect.dataset.summary import explain_loss
from throwcollect.errors import ConfigError, Interrupted, Problem
from throwcollect.plan.plan import Plan
from throwcollect.plan.slice import Slice
from throwcollect.wording import command


def collect_slice(
    directory: str | os.PathLike[str],
    slice: Slice,
    *,
    overrides: Sequence[str] = (),
    reporter: Reporter = SILENT,
    interruptions: Callable[[], int] = lambda: 0,
) -> bool:
    """Collect one slice of a dataset, in a directory of its own until it is finished.

    The collection begins with the recordings of earlier attempts at this slice.

    Args:
        directory: Directory of the dataset, with its configuration and its plan.
        slice: The slice.
        overrides: Keys to change that do not influence the data: ``key=value`` pairs, as ``--set`` takes them.
        reporter: Receives the progress.
        interruptions: How often the user has asked to stop: the first time, running trials are still finished.

    Returns:
        Whether there was anything to do.
    """
    directory = Path(directory)
    config = read_frozen_config(directory, overrides)
    plan = Plan.read(directory / PLAN, config).slice_of(slice)
    finished = find_finished(directory)
    # They could never be joined, which the join would report only after all tasks have run.
    if others := sorted({each.count for each in finished} - {slice.count}):
        raise ConfigError(
            f"{directory}: slice {slice} cannot be joined with those there, which are slices of {others[0]}",
            expected=f"slices I/{others[0]}",
        )
    if slice in finished:
        reporter.say(f"{directory}: slice {slice} is finished, nothing is left to do")
        return False
    again = command("up", "--slice", slice, "--output", directory)
    earlier = find_attempts(directory, slice)
    attempt = make_attempt(directory, slice)
    create(attempt, plan)
    take_recordings(earlier, attempt)
    remove_stopped(earlier)
    reporter.say(f"slice {slice}: trials {plan.trials.first} to {plan.trials.numbers[-1]}")
    with prepare_run(config, attempt, plan, reporter=reporter) as run:
        try:
            summary = run.collect(interruptions=interruptions)
        except Interrupted as error:
            mark_stopped(attempt)
            raise Interrupted(f"slice {slice}: {error.message}", hint=f"{again} goes on with it") from error
    if (lost := explain_loss(summary.outcomes, hint=f"{again} runs them again")) is not None:
        raise lost
    publish(attempt, directory, slice)
    return True


def read_frozen_config(directory: Path, overrides: Sequence[str] = ()) -> Config:
    """Read the configuration of a dataset that is to be collected in slices, with overrides as `collect_slice` has."""
    config = read_changed_config(directory, overrides)
    check_sliceable(config)
    return config


def read_changed_config(directory: Path, overrides: Sequence[str] = ()) -> Config:
    """Read the configuration of a dataset whose plan is frozen, with overrides as `collect_slice` has."""
    if not (directory / PLAN).is_file():
        raise ConfigError(
            f"{directory}: holds no plan", hint=command("plan", "CONFIG", "--output", directory) + " makes one"
        )
    kept = read_config(directory)
    with load_locating_errors(config_path(directory), overrides) as config:
        refuse_changes(directory, kept, config)
        if config.trials != kept.trials:
            raise ConfigError(
                [Problem(f"the plan in {directory} has {kept.trials}, got {config.trials}", key="trials")],
                expected="the same number, as tasks share the plan that lies there",
                hint="a dataset with another seed can be merged with it (throwcollect dataset merge)",
            )
        return config


def check_sliceable(config: Config) -> None:
    """Check that a configuration can be collected in slices."""
    if config.until is not None:
        raise ConfigError(
            [Problem("a dataset whose end depends on its results cannot be collected in slices", key="until")],
            expected="a fixed number of trials",
            hint="throwcollect up --listen and throwcollect join-run collect it on several nodes",
        )
    if config.run.open:
        raise ConfigError([Problem("should be false, as many users share the nodes of a cluster", key="run.open")])
