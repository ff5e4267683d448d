"""Checks a finished dataset: its files against the manifest, its tables against each other, its episodes against both.

What follows from a file that cannot be read is not checked; the manifest still covers every byte of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import pyarrow as pa

from throwcollect.config.loader import load
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import read_bag_metadata, refuse_other_directory
from throwcollect.dataset.directory import CONFIG, METADATA, PLAN, THROWS, TRIALS, config_path, shard_of
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import find_manifest_problems
from throwcollect.dataset.misses import read_targets
from throwcollect.dataset.summary_files import combine_digests, metadata_text
from throwcollect.dataset.throws_table import ThrowsTable, read_throws
from throwcollect.dataset.verify_plan import (
    CheckOf,
    find_drawing_problems,
    find_refusal_problems,
    find_wrong_trials,
    read_list,
)
from throwcollect.dataset.verify_recording import RecordingReport, check_recording
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError
from throwcollect.files import read_text
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import is_available as robot_is_available
from throwcollect.side_by_side import working_side_by_side
from throwcollect.sweep.plan import Plan

_MANY_EPISODES = 1000
"""From this number of episodes on, starting processes that check files side by side saves time."""
_MOST_BYTES = 100_000_000


def verify(directory: Path, *, check_of: CheckOf | None = None, processes: int = 1) -> list[Finding]:
    """Check a dataset.

    Checked are: size and hash of every file that the manifest covers; the plan, which is drawn again from the
    configuration; the columns of the table of throws; of each recording every byte, which is written again from its
    episodes; of each episode its hashes, its row in the table, for which it is judged again, and whether the ball flies
    ballistically where nothing touches it; the bag's metadata and the digest in them. Checks that need packages that
    are not installed are left out; `find_unchecked` names them.

    Args:
        directory: Its directory.
        check_of: Makes the check that says which trials the plan refuses; None leaves refusals unchecked.
        processes: How many processes may check the recordings of a large dataset. If more than one, they may import the
            program that calls this, as those of `multiprocessing` do.

    Returns:
        What is wrong, file by file; empty when nothing is.
    """
    refuse_other_directory(directory)
    findings, readable = [], True
    try:
        read_bag_metadata(directory)
    except DatasetError as error:
        if not (directory / METADATA).exists():
            raise
        findings.append(Finding.of(METADATA, error))
        readable = False
    tables = _read_tables(directory)
    # Other processes check the recordings, while this one hashes files and draws the plan again.
    with _checking_recordings(directory, tables, processes) as checked:
        findings += find_manifest_problems(directory, tables.config.name if tables.config else None)
        findings += tables.findings
        if tables.plan is not None:
            findings += find_drawing_problems(directory, tables.plan, tables.throws)
            if check_of is not None and robot_is_available(tables.plan.config):
                findings += find_refusal_problems(tables.plan, tables.wrong, check_of)
        reports = list(checked)
    findings += [finding for report in reports for finding in report.findings]
    if readable and tables.throws is not None:
        findings += _find_metadata_problems(directory, tables.throws, reports)
    return findings


def find_unchecked(config: Config) -> tuple[str, ...]:
    """List what `verify` leaves out, as packages of the extra ``collect`` are not installed; empty if nothing."""
    return () if robot_is_available(config) else ("whether the robot can do the trials", "what came of the throws")


@dataclass
class _Tables:
    """The contents of the files beside the recordings, as far as they can be read, and what is wrong with them.

    `wrong` are the trials whose values or seed in the plan do not fit their digest.
    """

    config: Config | None = None
    plan: Plan | None = None
    throws: pa.Table | None = None
    wrong: frozenset[int] = frozenset()
    findings: list[Finding] = field(default_factory=list)


def _read_tables(directory: Path) -> _Tables:
    tables = _Tables()
    file = CONFIG
    try:
        tables.config = config = load(config_path(directory))
        file = PLAN
        tables.plan = plan = Plan.read(directory / PLAN, config)
        if config.sweep.file == TRIALS:
            file = TRIALS
            read_list(directory, plan)
        for trial, digest in (wrong := find_wrong_trials(plan)).items():
            problem = f"has digest {plan.trial(trial).digest}, its values and seed give {digest}"
            tables.findings.append(Finding(PLAN, f"trial {trial}", problem))
        tables.wrong = frozenset(wrong)
        file = THROWS
        tables.throws = throws = read_throws(directory, plan)
        tables.findings += _find_unit_problems(throws.schema, ThrowsTable.of(plan).schema)
    except ForeignPlanError:
        problem = f"is not the configuration that {PLAN} was made for; one of the two was changed"
        tables.findings.append(Finding(CONFIG, "", problem))
    except ConfigError as error:
        tables.findings += [
            Finding(file, f"line {each.line}" if each.line else "", ": ".join(filter(None, [each.key, each.message])))
            for each in error.problems
        ]
    except DatasetError as error:
        tables.findings.append(Finding.of(file, error))
    return tables


def _find_unit_problems(schema: pa.Schema, expected: pa.Schema) -> Iterator[Finding]:
    """Find units of columns that are not theirs; exports take them over, while descriptions are for people alone."""
    for column in schema:
        stated, unit = ((each.metadata or {}).get(b"unit") for each in (column, expected.field(column.name)))
        if stated != unit:
            yield Finding(THROWS, column.name, f"has the unit {stated!r}, should be {unit!r}")


@contextmanager
def _checking_recordings(directory: Path, tables: _Tables, processes: int) -> Iterator[Iterator[RecordingReport]]:
    """Start to check the recordings that the plan places trials in, in order; none without plan and table."""
    if tables.plan is None or tables.throws is None:
        yield iter(())
        return
    plan, pieces, start = tables.plan, list[tuple[str, int, int]](), 0
    for name, trials in groupby(tables.throws["trial"].to_pylist(), key=lambda trial: shard_of(plan, trial)):
        pieces.append((name, start, count := sum(1 for _ in trials)))
        start += count
    with working_side_by_side(
        pieces,
        _make_check,
        (directory, plan, tables.throws),
        processes=processes if start >= _MANY_EPISODES else 1,
        doing="checks recordings",
        fork=True,
    ) as reports:
        yield log_progress(reports, len(pieces), "recording", "checked")


def _make_check(directory: Path, plan: Plan, throws: pa.Table) -> Callable[[tuple[str, int, int]], RecordingReport]:
    """Make the function that checks a recording, given its name, and the first and the number of its rows."""
    robot = robot_is_available(plan.config)

    def check_file(piece: tuple[str, int, int]) -> RecordingReport:
        name, first, count = piece
        rows = throws.slice(first, count).to_pylist()
        return check_recording(directory / name, plan, {row["trial"]: row for row in rows}, robot=robot)

    return check_file


def _find_metadata_problems(directory: Path, throws: pa.Table, reports: list[RecordingReport]) -> Iterator[Finding]:
    """Compare the bag's metadata with those that follow from the recordings."""
    files = [report for report in reports if report.has_file]
    summaries = [report.summary for report in files if report.summary is not None]
    channels = next((report.channels for report in files), None)
    # Other findings report the files that cannot be read; without them, the totals over all files are not known.
    if channels is None or len(summaries) < len(files):
        return
    digests = (report.digests[trial] for report in reports for trial in sorted(report.digests))
    expected = metadata_text(summaries, channels, combine_digests(digests, read_targets(throws)))
    there = read_text(directory / METADATA, most_bytes=_MOST_BYTES)
    if there != expected:
        lines = zip(there.splitlines(), expected.splitlines(), strict=False)
        number, (line, wanted) = next(
            ((at, pair) for at, pair in enumerate(lines, start=1) if pair[0] != pair[1]), (0, ("", ""))
        )
        problem = f"is {line.strip()[:200]!r}, the recordings give {wanted.strip()!r}" if number else "has another end"
        yield Finding(METADATA, f"line {number}" if number else "", problem)
