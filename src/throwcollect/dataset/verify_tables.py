"""Checks the files that describe a dataset as a whole: configuration, plan, and the table of throws."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.config.values import column_of
from throwcollect.dataset.directory import CONFIG, PLAN, SOURCES, THROWS, TRIALS, config_path, shard_of
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.recorded_trial import shorten
from throwcollect.dataset.throws_table import Row, RowsByTrial, ThrowsTable, read_throws_table
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError
from throwcollect.files import is_there
from throwcollect.sweep.digest import trial_digests
from throwcollect.sweep.plan import Plan
from throwcollect.sweep.point_file import read_points
from throwcollect.sweep.points import Points
from throwcollect.tasks.result import LOST, REFUSED


@dataclass
class Tables:
    """The contents of the files beside the recordings, as far as they can be read and do not contradict each other.

    Attributes:
        config: The configuration; None if it cannot be read or is not the plan's.
        plan: The trials; None if they cannot be read or are not the configuration's.
        throws: The table of throws; None if it cannot be read.
        rows: Its rows, by trial.
        doubtful: Trials whose values or seed in the plan do not fit their digest.
        findings: What is wrong.
    """

    config: Config | None = None
    plan: Plan | None = None
    throws: pa.Table | None = None
    rows: Mapping[int, Row] | None = None
    doubtful: set[int] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)


def check_tables(directory: Path) -> Tables:
    """Read and check configuration, plan and table of throws of a dataset."""
    tables = Tables()
    try:
        tables.config = load(config_path(directory))
    except ConfigError as error:
        tables.findings += [
            Finding(CONFIG, f"line {each.line}" if each.line else "", ": ".join(filter(None, [each.key, each.message])))
            for each in error.problems
        ]
    except DatasetError as error:
        tables.findings.append(Finding.of(CONFIG, error))
    if tables.config is not None:
        try:
            tables.plan = Plan.read(directory / PLAN, tables.config)
        except ForeignPlanError:
            problem = f"is not the configuration that {PLAN} was made for; one of the two was changed"
            tables.findings.append(Finding(CONFIG, "", problem))
            # Nothing says which of them is right, so all that follows from one of them stays unchecked.
            tables.config = None
        except DatasetError as error:
            tables.findings.append(Finding.of(PLAN, error))
    if tables.plan is not None and tables.plan.config.sweep.file == TRIALS:
        try:
            read_list(directory, tables.plan)
        except DatasetError as error:
            tables.findings.append(Finding.of(TRIALS, error))
    if tables.plan is not None:
        for trial, digest in find_wrong_trials(tables.plan).items():
            problem = f"has digest {tables.plan.trial(trial).digest}, its values and seed give {digest}"
            tables.findings.append(Finding(PLAN, f"trial {trial}", problem))
            tables.doubtful.add(trial)
        try:
            throws = read_throws_table(directory / THROWS, tables.plan)
        except DatasetError as error:
            tables.findings.append(Finding.of(THROWS, error))
        else:
            tables.findings += _find_unit_problems(throws.schema, ThrowsTable.of(tables.plan).schema)
            derived = is_there(directory / SOURCES)
            tables.findings += _find_row_problems(tables.plan, throws["trial"].to_pylist(), derived=derived)
            tables.throws, tables.rows = throws, RowsByTrial(throws)
            tables.findings += _find_plan_problems(tables.plan, tables.rows, tables.doubtful)
    return tables


def _find_unit_problems(schema: pa.Schema, expected: pa.Schema) -> Iterator[Finding]:
    """Find units of columns that are not theirs; exports take them over, while descriptions are for people alone."""
    for column in schema:
        stated, unit = ((each.metadata or {}).get(b"unit") for each in (column, expected.field(column.name)))
        if stated != unit:
            yield Finding(THROWS, column.name, f"has the unit {shorten(stated)}, should be {unit!r}")


def read_list(directory: Path, plan: Plan) -> Points:
    """Read the list of points that a dataset's own configuration names."""
    path = directory / TRIALS
    if not path.exists():
        raise DatasetError("is missing", path=path)
    try:
        points = read_points(path, plan.config)
    except ConfigError as error:
        raise DatasetError(error.problems[0].message, path=path) from error
    if points[: len(plan.trials)] != plan.trials.points:
        raise DatasetError(f"begins with other points than those of {PLAN}", path=path)
    return points


def find_wrong_trials(plan: Plan) -> dict[int, str]:
    """Find the trials of a plan that were changed since it was made, and the digests that their values and seeds give.

    Every trial has its digest in the plan.
    """
    trials = plan.trials
    digests = trial_digests(plan.config, trials.points, trials.seeds)
    wrong = np.flatnonzero((digests != trials.digests).any(axis=1)).tolist()
    return {trials.first + row: digests[row].tobytes().hex() for row in wrong}


def _find_row_problems(plan: Plan, trials: list[int | None], *, derived: bool) -> Iterator[Finding]:
    """Find what is wrong with the trials that the rows name, in their order; a derived dataset has some of the plan."""
    numbers = [trial for trial in trials if trial is not None]
    if len(numbers) < len(trials):
        yield Finding(THROWS, "", f"{len(trials) - len(numbers)} rows are of no trial")
    known = set(numbers)
    for trial in () if derived else plan.trials:
        if trial.number not in known:
            yield Finding(THROWS, f"trial {trial.number}", "has no row")
    seen: set[int] = set()
    for number in numbers:
        if not 0 <= number < len(plan.trials):
            yield Finding(
                THROWS, f"trial {number}", f"is not one of the plan, which has trials 0 to {len(plan.trials) - 1}"
            )
        elif number in seen:
            yield Finding(THROWS, f"trial {number}", "has more than one row")
        seen.add(number)
    if numbers != sorted(numbers):
        yield Finding(THROWS, "", "the rows are not in order of trials")


def _find_plan_problems(plan: Plan, rows: Mapping[int, Row], doubtful: Collection[int]) -> Iterator[Finding]:
    for trial in plan.trials:
        if (row := rows.get(trial.number)) is None:
            continue
        place = f"trial {trial.number}"
        for key, value in trial.values.items():
            # The plan itself is known to be wrong about a doubtful trial.
            if row[column := column_of(key)] != value and trial.number not in doubtful:
                yield Finding(THROWS, place, f"has {column} = {row[column]!r}, the plan {value!r}")
        for name in plan.trials.target_names:
            if row[name] != (planned := trial.target.get(name)):
                yield Finding(THROWS, place, f"has {name} = {row[name]!r}, the plan {planned!r}")
        if (row["outcome"] == REFUSED) != (trial.refused is not None):
            yield Finding(THROWS, place, f"is {row['outcome']}, the plan says {trial.refused or 'nothing against it'}")
        elif trial.refused is not None and row["reason"] != trial.refused:
            yield Finding(THROWS, place, f"was refused as {row['reason']!r}, in the plan as {trial.refused!r}")
        expected = None if row["outcome"] in (REFUSED, LOST) else shard_of(plan, trial.number)
        if row["shard"] != expected:
            yield Finding(THROWS, place, f"is {row['outcome']} with shard {row['shard']}, not {expected}")
