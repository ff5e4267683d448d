"""Checks a finished dataset: its files against the manifest, its tables against each other, its episodes against both.

What follows from a file that cannot be read is not checked; the manifest still covers every byte of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from throwcollect.config.motion import MotionFile
from throwcollect.config.scene import FileBodyConfig
from throwcollect.config.schema import Config
from throwcollect.dataset.bag import FileSummary, read_bag_metadata
from throwcollect.dataset.directory import (
    CARD,
    CONFIG,
    MANIFEST,
    METADATA,
    PLAN,
    PROVENANCE,
    THROWS,
    TRIALS,
    shard_of,
)
from throwcollect.dataset.manifest import FileEntry, Finding, find_changed_files, list_promised_names, read_manifest
from throwcollect.dataset.provenance import find_changes
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.shard import Recording
from throwcollect.dataset.summary_files import compute_digest, metadata_text
from throwcollect.dataset.throws_table import ThrowsTable
from throwcollect.dataset.verify_recording import RecordingCheck
from throwcollect.episode.channels import Channels
from throwcollect.errors import ConfigError, DatasetError, ForeignPlanError
from throwcollect.files import read_text
from throwcollect.plan.digest import trial_digests
from throwcollect.plan.plan import Plan
from throwcollect.plan.point_file import read_points
from throwcollect.plan.trials import Points
from throwcollect.progress_log import log_progress
from throwcollect.robots.body_files import files_of
from throwcollect.robots.description import is_available as robot_is_available
from throwcollect.robots.description import robot_of
from throwcollect.side_by_side import work_side_by_side
from throwcollect.tasks.motions import motions_of

_MANY_EPISODES = 1000
"""From this number of episodes on, starting processes that check files side by side saves time."""
_MOST_BYTES = 100_000_000
_Checked = tuple[list[Finding], Recording | None]
"""What `RecordingCheck` has found."""


def verify(directory: Path, *, processes: int = 1) -> list[Finding]:
    """Check a dataset.

    Checked are: size and hash of every file but logs; whether configuration and plan belong together; the columns of
    the table of throws; of each recording every byte, which is written again from its episodes; of each episode its
    hashes, its row in the table, for which it is judged again, and whether the object flies ballistically where nothing
    touches it; the bag's metadata and the digest in them. Checks that need packages that are not installed are left
    out; `find_unchecked` names them.

    Args:
        directory: Its directory.
        processes: How many processes may check the recordings of a large dataset. If more than one, they may import the
            program that calls this, as those of `multiprocessing` do.

    Returns:
        What is wrong, file by file; empty when nothing is.
    """
    if not (directory / METADATA).exists():
        # This raises the error that explains what the directory is.
        read_bag_metadata(directory)
    dataset, found = _open(directory)
    checks = [] if dataset is None else _check_recordings(dataset, processes)
    recordings = [recording for _, recording in checks if recording is not None]
    findings = find_damage(directory, in_full=True, hashed=[entry for _, entry in recordings])
    findings += [*found, *(finding for found, _ in checks for finding in found)]
    # Other findings report the recordings that are damaged; without them, the totals over all files are not known.
    if dataset is not None and recordings and not any(found for found, _ in checks):
        findings += _find_metadata_problems(dataset, [summary for summary, _ in recordings])
    return findings


def find_unchecked(config: Config) -> tuple[str, ...]:
    """List what `verify` leaves out, as packages of the extra ``collect`` are not installed; empty if nothing."""
    return () if robot_is_available(config) else ("what came of the throws",)


def find_damage(directory: Path, *, in_full: bool, hashed: Collection[FileEntry] = ()) -> list[Finding]:
    """Find the files of a finished dataset that are missing, changed, or not in its manifest.

    Data card and provenance differ between equal collections, so they are not in the manifest; the provenance has their
    hashes. In full, every byte of each file is read, unless it was `hashed` before, or else only its size is compared.
    """
    findings = [Finding(name, "", "is missing") for name in (CARD, PROVENANCE) if not (directory / name).exists()]
    if in_full and (directory / PROVENANCE).exists():
        findings += find_changes(directory)
    try:
        entries = read_manifest(directory)
    except DatasetError as error:
        return [*findings, Finding.of(MANIFEST, error)]
    covered = {entry.path for entry in entries}
    findings += find_changed_files(directory, entries, in_full=in_full, hashed=hashed)
    return findings + [
        Finding(name, "", f"is not in {MANIFEST}") for name in list_promised_names(directory) if name not in covered
    ]


def _open(directory: Path) -> tuple[Dataset | None, list[Finding]]:
    """Open a dataset and the files that its configuration names; None and what is wrong if one cannot be read."""
    findings = []
    try:
        dataset = Dataset.open(directory)
        config, plan = dataset.config, dataset.plan
        if isinstance(family := config.task.trajectory, MotionFile):
            motions_of(family, robot_of(config))
        for body in config.scene.bodies.values():
            if isinstance(body, FileBodyConfig):
                files_of(body)
        if config.sweep.file == TRIALS:
            read_list(directory, plan)
    except ForeignPlanError:
        problem = f"is not the configuration that {PLAN} was made for; one of the two was changed"
        return None, [Finding(CONFIG, "", problem)]
    except ConfigError as error:
        for each in error.problems:
            problem = ": ".join(filter(None, [each.key, each.message]))
            findings.append(Finding(CONFIG, f"line {each.line}" if each.line else "", problem))
        return None, findings
    except DatasetError as error:
        path = error.path or directory / CONFIG
        name = path.relative_to(directory) if path.is_relative_to(directory) else path
        return None, [Finding.of(str(name), error)]
    for trial, digest in find_wrong_trials(plan).items():
        problem = f"has digest {plan.trial(trial).digest}, its values and seed give {digest}"
        findings.append(Finding(PLAN, f"trial {trial}", problem))
    # Exports take units over, while descriptions are for people alone.
    for column, expected in zip(dataset.throws.schema, ThrowsTable.of(plan).schema, strict=True):
        stated, unit = ((each.metadata or {}).get(b"unit") for each in (column, expected))
        if stated != unit:
            findings.append(Finding(THROWS, column.name, f"has the unit {stated!r}, should be {unit!r}"))
    return dataset, findings


def _check_recordings(dataset: Dataset, processes: int) -> list[_Checked]:
    """Check the recordings that the plan places trials in, in order."""
    pieces, start = list[tuple[str, int, int]](), 0
    for name, trials in groupby(dataset.throws["trial"].to_pylist(), key=lambda trial: shard_of(dataset.plan, trial)):
        pieces.append((name, start, count := sum(1 for _ in trials)))
        start += count
    processes = processes if start >= _MANY_EPISODES else 1
    checks = work_side_by_side(
        pieces, _make_check, (dataset,), processes=processes, doing="checks recordings", fork=True
    )
    return list(log_progress(checks, len(pieces), "recording", "checked"))


def _make_check(dataset: Dataset) -> Callable[[tuple[str, int, int]], _Checked]:
    """Make the function that checks a recording, given its name, and the first and the number of its rows."""
    robot = robot_is_available(dataset.config)

    def check(piece: tuple[str, int, int]) -> _Checked:
        name, first, count = piece
        rows = dataset.throws.slice(first, count).to_pylist()
        found = RecordingCheck(dataset.directory / name, dataset.plan, {row["trial"]: row for row in rows}, robot=robot)
        return found.findings, found.recording

    return check


def _find_metadata_problems(dataset: Dataset, files: Sequence[FileSummary]) -> Iterator[Finding]:
    """Compare the bag's metadata with those that follow from the recordings."""
    channels = Channels(dataset.config, dataset.robot_description() or "")
    expected = metadata_text(files, channels, compute_digest(dataset.throws))
    there = read_text(dataset.directory / METADATA, most_bytes=_MOST_BYTES)
    if there != expected:
        lines = zip(there.splitlines(), expected.splitlines(), strict=False)
        number, (line, wanted) = next(
            ((at, pair) for at, pair in enumerate(lines, start=1) if pair[0] != pair[1]), (0, ("", ""))
        )
        problem = f"is {line.strip()[:200]!r}, the recordings give {wanted.strip()!r}" if number else "has another end"
        yield Finding(METADATA, f"line {number}" if number else "", problem)


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
