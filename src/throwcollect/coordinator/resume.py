"""Goes on with a dataset that a collection has left, whatever ended it: makes sure of its configuration and plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from throwcollect.config.loader import load, resolved_yaml
from throwcollect.config.problems import quoted
from throwcollect.config.schema import Config
from throwcollect.config.values import differences
from throwcollect.coordinator.prepare import checked_plan, listed_points, self_contained
from throwcollect.dataset.directory import CONFIG, METADATA, PLAN, TRIALS, config_path
from throwcollect.dataset.lock import held_alone
from throwcollect.dataset.reader import read_throws
from throwcollect.dataset.recovery import remove_unfinished
from throwcollect.errors import ConfigError, DatasetError, Problem
from throwcollect.files import remove, write_file
from throwcollect.sweep.plan import Plan, Trial
from throwcollect.sweep.table import encode_points
from throwcollect.tasks.throw import Outcome

_MAY_GROW = ("trials", "until.landed")


def begun(directory: Path) -> bool:
    """Whether a directory holds a dataset that was at least created."""
    return (directory / CONFIG).is_file() or (directory / PLAN).is_file()


def resume(config: Config, directory: Path, *, sweep_directory: Path) -> Plan:
    """Have a dataset's directory hold a configuration and its plan, of which some trials may have run already.

    Args:
        config: The configuration to go on with. It may differ in how it is run, and have more trials.
        directory: Directory of the dataset.
        sweep_directory: Where a relative `sweep.file` is looked for, should the plan be made anew.

    Raises:
        ConfigError: If the configuration is another one, or has fewer trials, or other ones.
        DatasetError: If another process changes the dataset, files cannot be written, or both the stored configuration
            and the plan are damaged.
    """
    with held_alone(directory):
        return _resumed(config, directory, sweep_directory)


def _resumed(given: Config, directory: Path, sweep_directory: Path) -> Plan:
    config = self_contained(given)
    stored = _stored(directory)
    if stored is not None:
        _refuse_changes(directory, stored, config)
    old = _stored_plan(directory, stored, config)
    remove_unfinished(directory)
    if old is None or old.config.without_run() != config.without_run():
        drawn = replace(checked_plan(given, directory=sweep_directory), config=config)
        plan = _extended(directory, old, drawn)
        if (listed := listed_points(given, directory=sweep_directory)) is not None:
            write_file(directory / TRIALS, encode_points(listed))
    else:
        plan = replace(old, config=config)
    if stored is not None and stored.without_run() != config.without_run():
        # It was perhaps finished by the configuration that it had; by this one it is not.
        remove(directory / METADATA)
    # A finished dataset stays as it is, and says nothing of how it is run.
    kept = config.without_run() if finished(directory, plan) else config
    if stored != kept:
        write_file(directory / CONFIG, resolved_yaml(kept).encode())
    if old is None or plan.trials != old.trials or kept.without_run() != old.config.without_run():
        plan.write(directory / PLAN)
    return plan


def finished(directory: Path, plan: Plan) -> bool:
    """Whether a dataset has every trial of a plan, and none of them was lost."""
    if not (directory / METADATA).is_file():
        return False
    try:
        return Outcome.LOST.value not in read_throws(directory, plan)["outcome"].to_pylist()
    except DatasetError:
        return False


def _stored(directory: Path) -> Config | None:
    """The configuration that a dataset was begun with; None unless it is there from its first key to its last."""
    try:
        path = config_path(directory)
        config = load(path)
        whole = path.read_text(encoding="utf-8") == resolved_yaml(config)
    except (ConfigError, OSError):
        return None
    return config if whole else None


def _stored_plan(directory: Path, stored: Config | None, config: Config) -> Plan | None:
    try:
        return Plan.read(directory / PLAN, stored or config)
    except DatasetError as error:
        if stored is None:
            # A power cut may have cost the configuration; then only the plan can tell that it was this one.
            hint = f"throwcollect up CONFIG --resume {directory}, as at first"
            raise DatasetError(error.message, hint=hint) from error
        return None


def _refuse_changes(directory: Path, stored: Config, config: Config) -> None:
    changed = differences(stored.without_run(), config.without_run())
    problems = [
        Problem(f"{directory} was begun with {quoted(before)}, got {quoted(after)}", key=key)
        for key, (before, after) in changed.items()
        if key not in _MAY_GROW or not _grows(before, after, config)
    ]
    if problems:
        raise ConfigError(problems, expected="the same configuration, but for `run`, `containers` and more `trials`")


def _grows(before: int | None, after: int | None, config: Config) -> bool:
    """Whether a number of trials or throws may take the place of another; none is the largest."""
    if not config.grows:
        # Its trials are counted.
        return True
    return after is None or (before is not None and after >= before)


def _extended(directory: Path, old: Plan | None, new: Plan) -> Plan:
    """The new plan, which has to begin with all trials of the old one."""
    if old is None:
        return new
    count = min(len(old.trials), len(new.trials))
    if count < len(old.trials) and not new.config.grows:
        raise ConfigError(
            [Problem(f"{directory} has {len(old.trials)} already, got {count}", key="trials")],
            expected=f"{len(old.trials)} or more",
            hint="throwcollect dataset sample takes some of them into a new dataset",
        )
    if _identities(old.trials[:count]) != _identities(new.trials[:count]):
        raise ConfigError(
            [Problem(f"the sampler {new.config.sweep.sampler} draws other trials when there are more", key="trials")],
            expected=f"{len(old.trials)}, as {directory} was begun with",
            hint="sobol and uniform go on where they ended; or merge datasets: throwcollect dataset merge",
        )
    return replace(new, trials=(*new.trials, *old.trials[count:]))


def _identities(trials: Sequence[Trial]) -> list[tuple[str, bool]]:
    return [(trial.digest, trial.refused is None) for trial in trials]
