"""Checks a finished dataset: every file against the others, against itself, and against physics.

A file that cannot be read is reported, and everything that does not depend on it is still checked.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from throwcollect.config.schema import Config
from throwcollect.dataset.bag import (
    BAG_SECTION,
    FileSummary,
    bag_information,
    from_yaml,
    read_bag_metadata,
    refuse_other_directory,
)
from throwcollect.dataset.data_card import HEADER, read_card
from throwcollect.dataset.directory import (
    CARD,
    FORMAT,
    METADATA,
    PROVENANCE,
    SHARD_SUFFIX,
    SOURCES,
    THROWS,
    TRIALS,
    shard_of,
)
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import find_manifest_problems
from throwcollect.dataset.misses import read_targets
from throwcollect.dataset.provenance import load_provenance
from throwcollect.dataset.summary_files import combine_digests
from throwcollect.dataset.throws_table import Row
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_plan import CheckOf, find_drawing_problems, find_refusal_problems
from throwcollect.dataset.verify_shard import ShardReport, check_shard
from throwcollect.dataset.verify_tables import Tables, check_tables, find_wrong_trials
from throwcollect.errors import DatasetError
from throwcollect.files import is_there
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import is_available as robot_is_available
from throwcollect.side_by_side import working_side_by_side
from throwcollect.sweep.digest import is_digest
from throwcollect.sweep.plan import Plan

_MANY_EPISODES = 1000
"""From this number of episodes on, starting processes that check files side by side saves time."""
_UNFINISHED = (".part", ".new")
_short = reprlib.Repr()
_short.maxstring = _short.maxother = 120
_short.maxlevel = _short.maxdict = _short.maxlist = 3
_shorten = _short.repr
"""Writes a value of a file in words, and cuts it, as somebody may have made it as large and deep as possible."""


def verify(
    directory: Path,
    *,
    check_of: CheckOf | None = None,
    processes: int = 1,
) -> list[Finding]:
    """Check a dataset.

    Checked are: every promised file against the manifest; the configuration and the plan against each other, and the
    plan is drawn again; the bag's metadata against the files; of each file every record, index, count and CRC, the
    latched topics and the order of trials; of each episode its digest, layout and stamps, and that the simulation can
    have recorded it; the table of throws against the episodes, which are judged again, and against the plan; and the
    dataset's digest. Checks that need packages that are not installed are left out; `find_unchecked` names them.

    Args:
        directory: Its directory.
        check_of: Makes the check that says which trials the plan refuses; None leaves refusals unchecked.
        processes: How many processes may check the recordings of a large dataset. If more than one, they may import the
            program that calls this, as those of `multiprocessing` do.

    Returns:
        What is wrong, file by file; empty when nothing is.
    """
    bag, findings = None, []
    refuse_other_directory(directory)
    try:
        bag = read_bag_metadata(directory)
        if unknown := sorted(map(str, set(from_yaml(directory / METADATA)) - {BAG_SECTION})):
            findings.append(Finding(METADATA, "", f"has unknown sections: {_shorten(unknown)}"))
    except DatasetError as error:
        if not (directory / METADATA).exists():
            raise
        findings.append(Finding.of(METADATA, error))
    tables = check_tables(directory)
    # Other processes check the recordings, while this one hashes files and draws the plan again.
    with _checking_shards(directory, tables, processes) as reports:
        findings += find_manifest_problems(directory, tables.config.name if tables.config else None)
        findings += tables.findings
        findings += _find_plan_problems(directory, tables, check_of)
        checks = dict(reports)
    findings += [finding for check in checks.values() for finding in check.findings]
    if bag is not None:
        findings += _find_bag_problems(bag, checks)
        # Targets are part of the digest, and the targets of a list are only in the plan.
        if tables.plan is not None or not (directory / TRIALS).exists():
            findings += _find_digest_problems(bag, tables, checks)
    findings += _find_stray_files(directory, checks)
    return findings


def find_unchecked(config: Config) -> tuple[str, ...]:
    """List what `verify` leaves out, as packages of the extra ``collect`` are not installed; empty if nothing."""
    if robot_is_available(config):
        return ()
    return "whether the robot can do the trials", "how its joints moved", "what came of the throws"


def _find_plan_problems(directory: Path, tables: Tables, check_of: CheckOf | None) -> Iterator[Finding]:
    if tables.plan is None:
        return
    yield from find_drawing_problems(directory, tables.plan, tables.rows)
    if check_of is not None and robot_is_available(tables.plan.config):
        yield from find_refusal_problems(tables.plan, tables.doubtful, check_of)


@contextmanager
def _checking_shards(directory: Path, tables: Tables, processes: int) -> Iterator[Iterator[tuple[str, ShardReport]]]:
    """Start to check the files that rows name, or all that are there if there are no rows."""
    expected = _list_trials_by_file(directory, tables)
    names = sorted(_list_shards(directory) if expected is None else expected)
    many = expected is not None and sum(map(len, expected.values())) >= _MANY_EPISODES
    with working_side_by_side(
        names,
        _make_file_check,
        (directory, tables, expected),
        processes=processes if many else 1,
        doing="checks recordings",
        fork=True,
    ) as reports:
        yield log_progress(zip(names, reports, strict=True), len(names), "recording", "checked")


def _make_file_check(
    directory: Path, tables: Tables, expected: Mapping[str, list[int]] | None
) -> Callable[[str], ShardReport]:
    """Make the function that checks a file of a dataset, by its name."""
    robot = tables.config is not None and robot_is_available(tables.config)
    check = EpisodeCheck(tables.plan, tables.rows or {}, doubtful=tables.doubtful, robot=robot)

    def check_file(name: str) -> ShardReport:
        trials = None if expected is None else expected[name]
        if tables.plan is not None and tables.plan.joined and tables.rows and trials:
            return _check_file_of_part(directory / name, tables.plan, tables.rows, trials, robot=robot)
        return check_shard(directory / name, tables.config, trials, check.find_problems)

    return check_file


def _check_file_of_part(
    path: Path, plan: Plan, rows: Mapping[int, Row], trials: Sequence[int], *, robot: bool
) -> ShardReport:
    """Check a file of a merged dataset, whose episodes have the numbers of the plan that they were collected by."""
    first = plan.first_of_part(trials[0])
    part = plan.part_from(first)
    own = {trial - first: {**rows[trial], "trial": trial - first} for trial in trials if trial in rows}
    check = EpisodeCheck(part, own, doubtful=find_wrong_trials(part), robot=robot)
    report = check_shard(path, plan.config, [trial - first for trial in trials], check.find_problems)
    report.digests = {first + trial: digest for trial, digest in report.digests.items()}
    return report


def _list_trials_by_file(directory: Path, tables: Tables) -> dict[str, list[int]] | None:
    """List the trials whose episodes each file should hold, in order; None if that is not known."""
    if tables.plan is None or tables.rows is None:
        return None
    names, expected = _list_shards(directory), dict[str, list[int]]()
    # A derived dataset has some trials of its plan.
    planned = () if is_there(directory / SOURCES) else range(len(tables.plan.trials))
    refused = tables.plan.trials.refused
    # The table may have rows of trials that the plan does not have, and lack others.
    for trial in sorted({*planned, *tables.rows}):
        name, row = shard_of(tables.plan, trial), tables.rows.get(trial)
        # If the row of a trial is missing, its episode is most likely in its file nevertheless.
        if (trial not in refused and name in names) if row is None else row["shard"] == name:
            expected.setdefault(name, []).append(trial)
    return expected


def _list_shards(directory: Path) -> set[str]:
    return {path.name for path in directory.iterdir() if path.suffix == SHARD_SUFFIX}


def _find_bag_problems(bag: Mapping[str, Any], checks: Mapping[str, ShardReport]) -> Iterator[Finding]:
    summaries = [check.summary for check in checks.values() if check.summary is not None]
    channels = next((check.channels for check in checks.values() if check.channels is not None), None)
    expected = bag_information(summaries, channels.all if channels else (), {})
    if unknown := sorted(map(str, set(bag) - set(expected))):
        yield Finding(METADATA, "", f"has unknown keys: {_shorten(unknown)}")
    del expected["custom_data"]
    if not channels:
        del expected["topics_with_message_count"]
    if len(summaries) < len(checks):
        # Other findings report the unreadable files; without them, the totals over all files are not known.
        yield from _find_file_problems(bag, summaries)
        return
    for key, value in expected.items():
        if not _are_same(bag.get(key), value):
            yield Finding(METADATA, key, f"is {_shorten(bag.get(key))}, the files give {_shorten(value)}")


def _find_file_problems(bag: Mapping[str, Any], summaries: list[FileSummary]) -> Iterator[Finding]:
    entries = bag.get("files")
    known = [each for each in entries if isinstance(each, dict)] if isinstance(entries, list) else []
    for summary in summaries:
        (expected,) = bag_information([summary], (), {})["files"]
        found = next((each for each in known if each.get("path") == summary.path), None)
        if not _are_same(found, expected):
            problem = f"is {_shorten(found)}, the file gives {_shorten(expected)}"
            yield Finding(METADATA, f"files: {summary.path}", problem)


def _are_same(value: object, other: object) -> bool:
    """Compare plain values with their types: readers in C++ do not take 9.0 or `true` for a whole number."""
    if isinstance(value, dict) and isinstance(other, dict):
        return value.keys() == other.keys() and all(_are_same(value[key], other[key]) for key in other)
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other) and all(map(_are_same, value, other))
    return type(value) is type(other) and value == other


def _find_digest_problems(
    bag: Mapping[str, Any], tables: Tables, checks: Mapping[str, ShardReport]
) -> Iterator[Finding]:
    custom = bag.get("custom_data")
    entries = custom if isinstance(custom, dict) else {}
    if entries.get("throwcollect.format") != FORMAT:
        yield Finding(
            METADATA, "custom_data: throwcollect.format", f"is {_shorten(entries.get('throwcollect.format'))}"
        )
    if unknown := sorted(map(str, set(entries) - {"throwcollect.format", "throwcollect.digest"})):
        yield Finding(METADATA, "custom_data", f"has unknown keys: {_shorten(unknown)}")
    digests = {trial: digest for check in checks.values() for trial, digest in check.digests.items()}
    damaged = any(check.summary is None for check in checks.values())
    if damaged:
        if tables.rows is None:
            return
        # For episodes that cannot be read, the digests are taken from the table.
        digests = {trial: row["digest"] for trial, row in tables.rows.items() if is_digest(row["digest"])} | digests
    targets = None if tables.throws is None else read_targets(tables.throws)
    written = entries.get("throwcollect.digest")
    digest = combine_digests((digests[trial] for trial in sorted(digests)), targets)
    if written != digest:
        giver = THROWS if damaged else "the episodes"
        yield Finding(
            METADATA,
            "custom_data: throwcollect.digest",
            f"is {_shorten(written)}, {giver} give{'s' * damaged} {digest}",
        )


def _find_stray_files(directory: Path, checks: Mapping[str, ShardReport]) -> Iterator[Finding]:
    for path in sorted(directory.iterdir()):
        if path.suffix in _UNFINISHED:
            yield Finding(path.name, "", "a file that was not written to its end")
        elif SHARD_SUFFIX in path.name and path.name not in checks:
            yield Finding(path.name, "", "no row of throws.parquet has its episode in this file")
    yield from _find_problems_beside(directory)


def _find_problems_beside(directory: Path) -> Iterator[Finding]:
    """Find what is wrong with the files that the manifest leaves out; earlier versions did not write the provenance."""
    if is_there(directory / PROVENANCE):
        try:
            load_provenance(directory / PROVENANCE)
        except DatasetError as error:
            yield Finding.of(PROVENANCE, error)
    if not is_there(directory / CARD):
        yield Finding(CARD, "", "is missing")
        return
    try:
        if not read_card(directory / CARD).startswith(HEADER):
            yield Finding(CARD, "", "has no YAML header, which dataset hubs read")
    except DatasetError as error:
        yield Finding.of(CARD, error)
