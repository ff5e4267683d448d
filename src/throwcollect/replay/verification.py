"""All checks of a finished dataset in one call: its files, rows and episodes, and some throws simulated again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from throwcollect.arguments import check_bounds
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.provenance import find_versions, read_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.extras import MissingExtraError
from throwcollect.files import StrPath
from throwcollect.replay.audit import replay_throws, require_simulating, select_trials

SAMPLE = 10
"""Number of throws that are simulated again by default."""


def verify_dataset(directory: StrPath, *, replay: int | None = None, processes: int = 1) -> list[Finding]:
    """Check a finished dataset: files against the manifest, rows against plan and episodes, flights against physics.

    Some throws, chosen by the seed of the dataset, are simulated again and compared bit for bit. Checks that take the
    robot's model are left out without the extra ``collect``; `dataset.verify.find_unchecked` names them.

    Args:
        directory: Its directory.
        replay: How many throws to simulate again; None for 10 if that can give the same bits here (`count_replayed`).
        processes: How many processes may check the recordings of a large dataset.

    Returns:
        The problems, file by file; empty if there are none.

    Raises:
        ConfigError: If a number is out of its range.
        DatasetError: If the directory holds no finished dataset.
        MissingExtraError: If throws are to be simulated, and the extra ``collect`` is not installed.
        WorkerError: If the physics engine does not start.
    """
    check_bounds("processes", processes, least=1)
    directory = Path(directory)
    if replay is not None:
        check_bounds("replay", replay, least=0)
    findings = verify(directory, processes=processes)
    try:
        dataset = Dataset.open(directory)
        if count := count_replayed(dataset, replay):
            findings += _find_different_throws(dataset, count)
    except ConfigError:
        # The files of the robot may be damaged.
        if not findings:
            raise
    except DatasetError as error:
        if not findings:
            findings.append(Finding("", "", f"cannot be replayed: {error.message}"))
    return findings


def count_replayed(dataset: Dataset, replay: int | None) -> int:
    """Count the throws that `verify_dataset` simulates again.

    Without a wish, throws are simulated again only where engine and libraries have the versions by which the dataset
    was collected, as others may give other bits.
    """
    if replay is None:
        provenance = read_provenance(dataset.directory)
        try:
            require_simulating(dataset.config.sim.engine)
        except MissingExtraError:
            return 0
        replay = SAMPLE if provenance is not None and provenance.libraries == find_versions() else 0
    return min(replay, len(dataset.recorded))


def _find_different_throws(dataset: Dataset, count: int) -> Iterator[Finding]:
    """Find throws that do not come out of the simulation as they are stored."""
    shards = dict(zip(dataset.throws["trial"].to_pylist(), dataset.throws["shard"].to_pylist(), strict=True))
    for comparison in replay_throws(dataset.directory, select_trials(dataset, sample=count)):
        if comparison.differences:
            problem = f"comes out differently: {'; '.join(comparison.differences)}"
            yield Finding(shards[comparison.trial], f"trial {comparison.trial}", problem)
