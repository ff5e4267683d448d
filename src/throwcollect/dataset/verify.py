"""Checks a finished dataset: every file against the others, against itself, and against physics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from throwcollect.config.loader import load
from throwcollect.dataset.bag import bag_information
from throwcollect.dataset.digest import combined_digest
from throwcollect.dataset.directory import CARD, CONFIG, FORMAT, METADATA, PLAN, THROWS, shard_name
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.reader import read_bag_metadata, read_throws
from throwcollect.dataset.throws import REFUSED
from throwcollect.dataset.verify_episode import EpisodeCheck
from throwcollect.dataset.verify_shard import ShardCheck
from throwcollect.errors import ThrowcollectError
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.throw import Outcome

_WITHOUT_EPISODE = (REFUSED, Outcome.LOST.value)

Rows = list[dict[str, Any]]


def verify(directory: Path) -> list[Finding]:
    """Check a dataset.

    Checked are: the bag's metadata against the files; of each file every record, index, count and CRC, the latched
    topics and the order of trials; of each episode its digest, layout, stamps, and flight, which must be ballistic;
    the table of throws against the episodes, which are judged again, and against the plan; and the dataset's digest.

    Args:
        directory: Its directory.

    Returns:
        What is wrong, file by file; empty when nothing is.

    Raises:
        DatasetError: If the directory holds no finished dataset.
    """
    bag = read_bag_metadata(directory)
    place = CONFIG
    try:
        config = load(directory / CONFIG)
        place = PLAN
        plan = Plan.read(directory / PLAN, config)
        place = THROWS
        rows: Rows = read_throws(directory, plan).to_pylist()
    except ThrowcollectError as error:
        return [Finding(place, "", str(error).removeprefix(f"{directory / place}: "))]
    findings = [*_plan_findings(plan, rows), *_placement_findings(plan, rows)]
    checks = _check_shards(directory, plan, rows)
    findings += [finding for check in checks.values() for finding in check.findings]
    findings += _bag_findings(bag, checks)
    findings += _stray_findings(directory, set(checks))
    return findings


def _plan_findings(plan: Plan, rows: Rows) -> Iterator[Finding]:
    for trial, row in zip(plan.trials, rows, strict=True):
        place = f"trial {trial.number}"
        for key, value in trial.values.items():
            if row[key] != value:
                yield Finding(THROWS, place, f"has {key} = {row[key]!r}, the plan {value!r}")
        if (row["outcome"] == REFUSED) != (trial.refused is not None):
            yield Finding(THROWS, place, f"is {row['outcome']}, the plan says {trial.refused or 'nothing against it'}")
        elif trial.refused is not None and row["reason"] != trial.refused:
            yield Finding(THROWS, place, f"was refused as {row['reason']!r}, in the plan as {trial.refused!r}")


def _placement_findings(plan: Plan, rows: Rows) -> Iterator[Finding]:
    record = plan.config.record
    for row in rows:
        expected = None
        if row["outcome"] not in _WITHOUT_EPISODE:
            expected = shard_name(plan.config.name, row["trial"] // record.trials_per_shard)
        if row["shard"] != expected:
            yield Finding(
                THROWS, f"trial {row['trial']}", f"is {row['outcome']} with shard {row['shard']}, not {expected}"
            )


def _check_shards(directory: Path, plan: Plan, rows: Rows) -> dict[str, ShardCheck]:
    problems = EpisodeCheck(plan).problems
    by_shard: dict[str, Rows] = {}
    for row in rows:
        if row["shard"] is not None:
            by_shard.setdefault(Path(row["shard"]).name, []).append(row)
    return {
        name: ShardCheck(directory / name, plan.config, members, problems) for name, members in sorted(by_shard.items())
    }


def _bag_findings(bag: Mapping[str, Any], checks: Mapping[str, ShardCheck]) -> Iterator[Finding]:
    digests = {trial: digest for check in checks.values() for trial, digest in check.digests.items()}
    digest = combined_digest(digests[trial] for trial in sorted(digests))
    custom = bag.get("custom_data")
    written = custom.get("throwcollect.digest") if isinstance(custom, dict) else None
    if written != digest:
        yield Finding(METADATA, "custom_data: throwcollect.digest", f"is {written}, the episodes give {digest}")
    summaries = [check.summary for check in checks.values() if check.summary is not None]
    channels = next((check.channels for check in checks.values() if check.channels is not None), None)
    if channels is None or len(summaries) != len(checks):
        return  # what the files hold is not known in full; that is a finding already
    expected = bag_information(
        summaries, channels.all, {"throwcollect.format": FORMAT, "throwcollect.digest": str(written)}
    )
    yield from (
        Finding(METADATA, key, f"is {_shortened(bag.get(key))}, the files give {_shortened(value)}")
        for key, value in expected.items()
        if bag.get(key) != value
    )
    if unknown := sorted(set(bag) - set(expected)):
        yield Finding(METADATA, "", f"has unknown keys: {', '.join(unknown)}")


def _stray_findings(directory: Path, shards: set[str]) -> Iterator[Finding]:
    for path in sorted(directory.iterdir()):
        if ".mcap" in path.name and path.name not in shards:
            yield Finding(path.name, "", "no row of throws.parquet has its episode in this file")
        elif path.suffix in (".part", ".new"):
            yield Finding(path.name, "", "a file that was not written to its end")
    if not (directory / CARD).is_file():
        yield Finding(CARD, "", "is missing")


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 120 else f"{text[:117]}..."
