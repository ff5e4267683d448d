"""Creates the directory of a dataset, with its configuration and its plan, before a trial runs."""

from __future__ import annotations

import shutil
from contextlib import ExitStack, suppress
from pathlib import Path

from throwcollect.config.schema import BODIES, MOTIONS, Config
from throwcollect.dataset.bag import MOST_FILES
from throwcollect.dataset.carried_robot import write_config
from throwcollect.dataset.directory import CONFIG, PLAN, ROBOT, TRIALS, is_begun
from throwcollect.dataset.lock import hold_lock
from throwcollect.errors import ConfigError, Problem
from throwcollect.files import write_file
from throwcollect.plan.plan import Plan
from throwcollect.plan.point_file import encode_points
from throwcollect.plan.trials import Points
from throwcollect.wording import command


def create(directory: Path, plan: Plan, *, listed: Points | None = None) -> None:
    """Write the directory of a dataset of which no trial has run yet.

    Args:
        directory: Must not exist, or be empty.
        plan: The trials and their configuration.
        listed: Points for ``trials.parquet``, where the sampler of the configuration finds them; None if it needs none.
    """
    refuse_many_files(plan.config, len(plan.trials))
    try:
        # A directory that the user made before is left in place if this fails.
        made = not directory.exists()
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _make_unusable_error(directory, error) from error
    with hold_lock(directory, needed=False), ExitStack() as undo:
        refuse_taken(directory)
        undo.callback(remove_plan, directory, made=made)
        write_config(directory, plan.config)
        # An empty plan marks the dataset and is made again, so a collection that is killed in the meantime can go on.
        write_file(directory / PLAN, b"")
        if listed is not None:
            write_file(directory / TRIALS, encode_points(listed))
        plan.write(directory / PLAN)
        # Everything is written, so nothing is undone.
        undo.pop_all()


def refuse_many_files(config: Config, trials: int) -> None:
    """Refuse a dataset with so many recordings that no command would read its metadata."""
    files = -(-trials // config.record.trials_per_shard)
    if files > MOST_FILES:
        raise ConfigError(
            [Problem(f"{trials} trials would be in {files} files", key="record.trials_per_shard")],
            expected=f"at most {MOST_FILES} files, so {-(-trials // MOST_FILES)} trials a file or more",
        )


def refuse_taken(directory: Path) -> None:
    """Refuse a directory that holds anything; one that does not exist yet is as good as an empty one."""
    try:
        taken = sorted(path.name for path in directory.iterdir())
    except FileNotFoundError:
        return
    except OSError as error:
        raise _make_unusable_error(directory, error) from error
    if taken:
        raise ConfigError(
            f"{directory}: holds {', '.join(taken[:3])}{' and more' if taken[3:] else ''}",
            expected="a directory that is new or empty",
            hint="choose another one with --output"
            + (f", or go on: {command('resume', directory)}" if is_begun(directory) else ""),
        )


def remove_plan(directory: Path, *, made: bool) -> None:
    """Remove the files of a plan that `create` has written and, if the directory was made for them, the directory.

    Files that are gone already, or that cannot be removed, are no error, because this cleans up after one.
    """
    with suppress(OSError):
        for name in (CONFIG, PLAN, TRIALS, MOTIONS):
            (directory / name).unlink(missing_ok=True)
        for name in (ROBOT, BODIES):
            shutil.rmtree(directory / name, ignore_errors=True)
        if made:
            directory.rmdir()


def _make_unusable_error(directory: Path, error: OSError) -> ConfigError:
    return ConfigError(f"{directory}: cannot be used as directory of a dataset: {error.strerror}")
