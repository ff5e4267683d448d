"""All checks of a finished dataset in one call: files, physics, refusals of the plan, and throws simulated again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from throwcollect.arguments import check_bounds
from throwcollect.coordinator.prepare import feasibility_check
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.errors import DatasetError
from throwcollect.files import StrPath
from throwcollect.replay.audit import replay_throws, require_simulating, select_trials


def verify_dataset(
    directory: StrPath,
    *,
    replay: int | None = None,
    processes: int = 1,
) -> list[Finding]:
    """Check a finished dataset: its files against each other, its episodes against physics, its plan against the robot.

    Checks that take the robot's model are left out without the extra ``collect``; `dataset.verify.find_unchecked` names
    them.

    Args:
        directory: Its directory.
        replay: How many throws, chosen by the seed of the dataset, to simulate again and to compare bit for bit; None
            for none.
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
    if replay is not None:
        check_bounds("replay", replay, least=0)
        # If the dataset cannot be opened, `verify` below reports why.
        with suppress(DatasetError):
            require_simulating(Dataset.open(directory).config.sim.engine)
    directory = Path(directory)
    findings = verify(directory, check_of=feasibility_check, processes=processes)
    if replay is not None:
        findings += _replay_findings(directory, replay)
    return findings


def _replay_findings(directory: Path, count: int) -> Iterator[Finding]:
    """Find throws that do not come out of the simulation as they are stored."""
    try:
        dataset = Dataset.open(directory)
        shards = dict(zip(dataset.throws["trial"].to_pylist(), dataset.throws["shard"].to_pylist(), strict=True))
        for comparison in replay_throws(directory, select_trials(dataset, sample=count)):
            if comparison.differences:
                problem = f"comes out differently: {'; '.join(comparison.differences)}"
                yield Finding(shards[comparison.trial], f"trial {comparison.trial}", problem)
    except DatasetError as error:
        # The hint of the error would recommend the command that has called this function.
        error.hint = None
        yield Finding("", "", f"cannot be replayed: {error}")
