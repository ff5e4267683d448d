"""Prepares a dataset that an earlier collection has left for the next one, or finishes it with what is whole of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from throwcollect.collect.coordinator.prepare import draw_plan, make_self_contained, prepare, read_listed_points
from throwcollect.collect.coordinator.reporter import SILENT, Reporter
from throwcollect.config.loader import load, load_locating_errors
from throwcollect.config.motion import SESSION
from throwcollect.config.problems import quote
from throwcollect.config.schema import Config
from throwcollect.config.values import differences
from throwcollect.dataset.carried_robot import carry_robot, config_text, find_files, write_config
from throwcollect.dataset.configuration import read_config
from throwcollect.dataset.directory import METADATA, PLAN, SOURCES, THROWS, TRIALS, config_path, is_begun
from throwcollect.dataset.lock import hold_lock
from throwcollect.dataset.provenance import read_provenance
from throwcollect.dataset.recovery import remove_unfinished
from throwcollect.dataset.throws_table import read_throws, read_throws_table
from throwcollect.dataset.verify import find_damage, find_wrong_trials, read_list
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError, Problem
from throwcollect.files import check_regular, remove, write_file
from throwcollect.plan.plan import Plan
from throwcollect.plan.point_file import encode_points
from throwcollect.plan.trials import Points
from throwcollect.tasks.result import LOST, REFUSED, Result
from throwcollect.wording import command

_NO_EPISODE = "no whole episode of it was left"


def resume(
    config: Config,
    directory: Path,
    *,
    sweep_directory: Path,
    processes: int = 1,
    before_writing: Callable[[], object] = lambda: None,
    reporter: Reporter = SILENT,
) -> Plan:
    """Write a configuration and its plan into a dataset's directory; some of its trials may have run already.

    The files of a finished dataset are compared byte for byte with its manifest. If one is missing or damaged, the
    dataset counts as unfinished from then on.

    Args:
        config: The configuration to go on with. It may differ in how it is run, and have more trials.
        directory: Directory of the dataset.
        sweep_directory: Where a relative `sweep.file` is looked for, should the plan be made anew.
        processes: How many processes may check the trials of a large plan, as for `draw_plan`.
        before_writing: Is called before anything is written, unless every trial has ended; what it raises leaves the
            dataset as it is.
        reporter: Gets a warning for each file of a finished dataset that is missing or damaged.
    """
    with hold_lock(directory):
        _refuse_uncollected(directory, config)
        given = make_self_contained(config)
        stored = _read_stored_config(directory)
        if stored is not None:
            refuse_changes(directory, stored, given)
            # The files may be damaged; those of the given configuration are the same.
            carry_robot(given, directory)
        if find_files(given) is not None:
            _ = given.robot.find().directory
        damaged = _find_damaged(directory, reporter)
        old = None if PLAN in damaged else _read_stored_plan(directory, stored, given)
        # The list may be read and written below, and a link in its place could lead to any file of the user.
        check_regular(directory / TRIALS)
        plan, listed = _make_plan(config, directory, sweep_directory, old, damaged, processes, reporter)
        # The dataset may be finished only by its earlier configuration, or by files that are gone.
        changes = bool(damaged) or (stored is not None and stored.without_run() != plan.config.without_run())
        ended = not changes and has_all_trials(directory, plan)
        if not ended:
            before_writing()
        remove_unfinished(directory)
        if ended:
            return plan
        if listed is not None:
            write_file(directory / TRIALS, encode_points(listed))
        if changes:
            remove(directory / METADATA)
        replanned = old is None or plan.trials is not old.trials
        if replanned:
            # Were this process killed here, the plan must not lie next to another configuration. If it is empty, it is
            # made again, and the directory still holds a dataset.
            write_file(directory / PLAN, b"")
        write_config(directory, plan.config)
        if replanned:
            plan.write(directory / PLAN)
        return plan


def _refuse_uncollected(directory: Path, config: Config) -> None:
    """Refuse a dataset of which no trial was collected."""
    if (directory / SOURCES).exists():
        raise DatasetError(
            "was derived from other datasets, so nothing is collected into it",
            path=directory,
            hint="derive it again if it is damaged",
        )
    if config.task.policy is not None and config.task.policy.use == SESSION:
        raise DatasetError(
            "was recorded in a session, so nothing of it can be simulated again",
            path=directory,
            hint=f"{command('sim', 'CONFIG', '--record', directory)} records more into it",
        )


def prepare_or_resume(path: Path, directory: Path) -> Plan:
    """Write the plan of a configuration's file into a dataset's directory, or keep that of an earlier collection."""
    freeze = resume if is_begun(directory) else prepare
    with load_locating_errors(path) as config:
        return freeze(config, directory, sweep_directory=path.parent)


def _make_plan(
    given: Config,
    directory: Path,
    sweep_directory: Path,
    old: Plan | None,
    damaged: Collection[str],
    processes: int,
    reporter: Reporter,
) -> tuple[Plan, Points | None]:
    """Make the plan to go on with: the old one, or what the configuration draws, which has to begin with the old one.

    Returns:
        The plan, and the list of its trials, if that has to be written.
    """
    config = make_self_contained(given)
    if old is not None and old.config.without_run() == config.without_run():
        own_list, there = given.sweep.file is not None and sweep_directory.samefile(directory), None
        if given.sweep.file is not None and TRIALS not in damaged:
            with suppress(DatasetError):
                there = read_list(directory, old)
        wanted = (there or old.trials.points) if own_list else read_listed_points(given, directory=sweep_directory)
        if own_list or there == wanted:
            # The digest of the plan also depends on the order of keys, which may have been changed in the file.
            return replace(old, config=old.config.run_as(config)), None if there == wanted else wanted
    drawn = draw_plan(given, directory=sweep_directory, processes=processes, reporter=reporter)
    plan = _extend(directory, old, replace(drawn, config=config))
    return plan, read_listed_points(given, directory=sweep_directory)


def _find_damaged(directory: Path, reporter: Reporter) -> frozenset[str]:
    """Find the names of files of a finished dataset that are missing or damaged; none if it is not finished."""
    if not (directory / METADATA).exists():
        return frozenset()
    findings = find_damage(directory, in_full=True)
    for finding in findings:
        reporter.warn(f"{directory}: {finding}")
    return frozenset(finding.file for finding in findings)


def has_all_trials(directory: Path, plan: Plan) -> bool:
    """Whether a dataset has every trial of a plan, and none of them was lost."""
    if not (directory / METADATA).is_file():
        return False
    try:
        return LOST not in read_throws(directory, plan)["outcome"].to_pylist()
    except DatasetError:
        # A table that cannot be read leaves open whether a trial was lost.
        return False


def is_complete(directory: Path) -> bool:
    """Whether a directory holds a dataset in which nothing is left to collect, and no file of it is missing."""
    try:
        plan = Plan.read(directory / PLAN, read_config(directory))
        return has_all_trials(directory, plan) and not find_damage(directory, in_full=False)
    except (ConfigError, DatasetError):
        return False


def _read_stored_config(directory: Path) -> Config | None:
    """Read the configuration that a dataset was begun with; None unless its file is complete."""
    try:
        path = config_path(directory)
        config = load(path)
        # Compare the whole text: one that a power cut has cut off may still be valid, with defaults for missing keys.
        return config if path.read_text(encoding="utf-8") == config_text(config) else None
    except (ConfigError, DatasetError, OSError):
        return None


def _read_stored_plan(directory: Path, stored: Config | None, config: Config) -> Plan | None:
    """Read the plan; None if it is missing or damaged, and the configuration is there, from which it is drawn again."""
    try:
        plan = Plan.read(directory / PLAN, stored or config)
    except ForeignPlanError:
        raise
    except DatasetError:
        # Without the stored configuration, it is unknown whether the given one is that of the dataset.
        if stored is None:
            raise
        return None
    return None if find_wrong_trials(plan) else plan


def refuse_changes(directory: Path, stored: Config, config: Config) -> None:
    """Refuse a configuration that differs from the stored one, with which a dataset was begun."""
    changed = differences(stored.without_run(), config.without_run())
    problems = [
        Problem(f"{directory} was begun with {quote(before)}, got {quote(after)}", key=key)
        for key, (before, after) in changed.items()
        if not (key == "trials" or key.startswith("until.")) or not _is_growth(before, after, config)
    ]
    if problems:
        same = "the same configuration, but for `run`, `containers`, `cluster` and more `trials`"
        raise ConfigError(problems, expected=same)


def _is_growth(before: int | None, after: int | None, config: Config) -> bool:
    """Whether a number of trials may replace an earlier one; None stands for no limit."""
    # Without `until`, `_extend` compares the trials.
    return config.until is None or after is None or (before is not None and after >= before)


def _extend(directory: Path, old: Plan | None, new: Plan) -> Plan:
    """Check that the new plan begins with the trials of the old one."""
    if old is None:
        return new
    count = min(len(old.trials), len(new.trials))
    if count < len(old.trials) and new.config.until is None:
        raise ConfigError(
            [Problem(f"{directory} has {len(old.trials)} already, got {count}", key="trials")],
            expected=f"{len(old.trials)} or more",
        )
    before, after = old.trials[:count], new.trials[:count]
    targets = before.points.targets, after.points.targets
    are_same = np.array_equal(before.digests, after.digests) and np.array_equal(*targets, equal_nan=True)
    # With `until`, the collection checks most of the trials.
    if not are_same or (new.config.until is None and before.refused.keys() != after.refused.keys()):
        drawn = "the list" if new.config.sweep.file is not None else f"the sampler {new.config.sweep.sampler}"
        raise ConfigError(
            [Problem(f"{drawn} begins with other trials or targets than {directory} has", key="sweep")],
            expected="a list with further rows below, or a sampler that goes on where it ended: sobol, uniform",
        )
    return new


def finish_without_simulating(
    config: Config, directory: Path, *, sweep_directory: Path, reporter: Reporter = SILENT
) -> None:
    """Finish a dataset with the episodes that are whole, and give all other trials up as lost; else as `resume`.

    A finished dataset of which nothing is missing or damaged stays as it is.
    """
    plan = resume(config, directory, sweep_directory=sweep_directory, reporter=reporter)
    if (directory / METADATA).exists():
        reporter.say(f"{directory}: is finished, and no file of it is missing or damaged")
        return
    provenance, rows = read_provenance(directory), {}
    with suppress(DatasetError):
        rows = {row["trial"]: row for row in read_throws_table(directory / THROWS, plan).to_pylist()}
    there: list[int] = []
    wanted = math.inf if plan.config.until is None else plan.config.until.wanted

    def keep(trial: int, result: Result) -> bool:
        """Note an episode; with `until`, drop those that follow the last trial that is wanted."""
        nonlocal wanted
        if wanted <= 0:
            return False
        there.append(trial)
        wanted -= result.outcome.value == plan.config.task.success
        return True

    with closing(DatasetWriter.open(directory)) as writer:
        writer.recover(keep)
        known = {trial: row["reason"] for trial, row in rows.items() if row["outcome"] in (LOST, REFUSED)}
        if plan.config.until is not None:
            # Where the dataset ends without the missing trials is not known, so it ends with the last known one.
            last = max([*there, *(rows if wanted > 0 else ())], default=plan.trials.first)
            for trial in writer.list_missing():
                if trial in known and rows[trial]["outcome"] == REFUSED:
                    writer.refuse(trial, known[trial])
            writer.end_with(last)
        for trial in writer.list_missing():
            writer.append_lost(trial, known.get(trial, _NO_EPISODE))
        writer.finish(provenance=provenance)
