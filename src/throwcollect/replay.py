"""Verifies a finished dataset, and simulates its throws again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from throwcollect.dataset.manifest import Finding
from throwcollect.dataset.provenance import find_versions, read_provenance
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import ConfigError, DatasetError, check_bounds
from throwcollect.extras import MissingExtraError, require, require_engine
from throwcollect.files import StrPath
from throwcollect.plan.trials import choose_trials
from throwcollect.progress_log import log_progress
from throwcollect.robots.description import full_description
from throwcollect.sensing.recorder import SensorRecorder
from throwcollect.side_by_side import count_cores, limit_processes, work_side_by_side
from throwcollect.wording import join_names

SAMPLE, RENDERED = 10, 2
"""Numbers of throws that are simulated again by default, and of those whose frames are rendered again."""

_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Comparison:
    """How a stored throw differs from the same throw, simulated again: a sentence for each difference.

    There are no differences if the episodes, whose digests are here, too, are the same bit for bit.
    """

    trial: int
    stored: str
    again: str
    differences: tuple[str, ...]


def select_trials(dataset: Dataset, *, sample: int | None = None) -> list[int]:
    """List the trials that have an episode, in order; with `sample`, only that many, always the same random choice.

    Raises:
        DatasetError: If no trial has one.
    """
    trials: list[int] = dataset.recorded.throws["trial"].to_pylist()
    if not trials:
        raise DatasetError(f"{dataset.directory}: no trial has an episode")
    return trials if sample is None else choose_trials(trials, count=sample, seed=dataset.config.seed)


def replay_throws(directory: Path, trials: Sequence[int]) -> Iterator[Comparison]:
    """Simulate stored throws of a dataset again on all cores, and compare them, in the given order."""
    require_simulating(Dataset.open(directory).config.sim.engine)
    return _work_on(directory, trials, _begin, "simulates", "simulated")


def _work_on(
    directory: Path, trials: Sequence[int], begin: Callable[..., Callable[[int], _Found]], doing: str, done: str
) -> Iterator[_Found]:
    """Work on trials of a dataset on all cores; `begin` and `doing` are those of `work_side_by_side`."""
    processes = limit_processes(count_cores(), len(trials))
    found = work_side_by_side(trials, begin, (directory,), processes=processes, doing=doing)
    return log_progress(found, len(trials), "throw", done)


def require_simulating(engine: str) -> None:
    """Check that the libraries for simulating by an engine are installed, before anything begins."""
    require_engine(engine)
    require("pinocchio")


def _begin(directory: Path) -> Callable[[int], Comparison]:
    """Open dataset and simulation in a process, which keeps both from one trial to the next."""
    # This import needs the extra `collect`, but datasets can be verified without it.
    from throwcollect.sim.simulator import Simulator

    dataset = Dataset.open(directory)
    simulator = Simulator(dataset.config)

    def replay(number: int) -> Comparison:
        """Simulate a trial, and compare it with the stored one."""
        # A merged dataset has numbers of its own, and episodes those of their own plans.
        trial = replace(dataset.plan.trial(number), number=number - dataset.plan.first_of_part(number))
        again = simulator.run(trial)
        stored = dataset.throw(number)
        with stored.locating_damage():
            return replace(compare(stored.read_episode(), again), trial=number)

    return replay


def compare(stored: Episode, again: Episode) -> Comparison:
    """Compare two episodes of one trial."""
    stored.chunk.check_records()
    differences: tuple[str, ...] = ()
    # This compares contents and not chunks, as the same messages may be compressed in different ways.
    if (stored.chunk.contents, stored.header_json) != (again.chunk.contents, again.header_json):
        differences = tuple(_find_differences(stored, again)) or ("other channels than joint states and ball differ",)
    return Comparison(stored.header.trial, stored.digest, again.digest, differences)


def _find_differences(stored: Episode, again: Episode) -> Iterator[str]:
    for field in fields(EpisodeHeader):
        before, now = getattr(stored.header, field.name), getattr(again.header, field.name)
        if before != now:
            yield f"{field.name}: {before} stored, {now} now"
    one, other = stored.samples(again.table.joints), again.samples()
    count = min(len(one), len(other))
    for column in fields(Samples):
        before, now = getattr(one, column.name)[:count], getattr(other, column.name)[:count]
        rows = np.flatnonzero((before != now).reshape(count, -1).any(axis=1))
        if len(rows):
            largest = np.abs(before.astype(np.float64) - now).max()
            time_s = (one.stamps_ns[rows[0]] - one.stamps_ns[0]) / 1e9
            yield f"{column.name}: from {time_s:.3f} s on, by up to {largest:.3g}"


def verify_dataset(
    directory: StrPath, *, replay: int | None = None, render: int | None = None, processes: int = 1
) -> list[Finding]:
    """Check a finished dataset: files against the manifest, rows against plan and episodes, flights against physics.

    Some throws, chosen by the seed of the dataset, are simulated again and compared bit for bit, and so is what sensors
    see of some. Checks that take the robot's model are left out without the extra ``collect``;
    `dataset.verify.find_unchecked` names them.

    Args:
        directory: Its directory.
        replay: How many throws to simulate again; None for 10 if that can give the same bits here (`count_replayed`).
        render: Of how many throws to render again what sensors see; None for 2.
        processes: How many processes may check the recordings of a large dataset.

    Returns:
        The problems, file by file; empty if there are none.

    Raises:
        ConfigError: If a number is out of its range.
        DatasetError: If the directory holds no finished dataset.
        MissingExtraError: If throws are to be simulated, and the extra ``collect`` is not installed.
        WorkerError: If the physics engine does not start.
    """
    directory = Path(directory)
    if replay is not None:
        check_bounds("replay", replay, least=0)
    findings = verify(directory, processes=processes)
    try:
        dataset = Dataset.open(directory)
        if count := count_replayed(dataset, replay):
            findings += _find_different_throws(dataset, count)
        if dataset.config.sensors and len(dataset.recorded):
            findings += _find_different_frames(dataset, RENDERED if render is None else render)
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
        policy = dataset.config.task.policy
        same = provenance is not None and provenance.libraries == find_versions()
        replay = SAMPLE if same and (policy is None or policy.reproducible) else 0
    return min(replay, len(dataset.recorded))


def _find_different_throws(dataset: Dataset, count: int) -> Iterator[Finding]:
    """Find throws that do not come out of the simulation as they are stored."""
    shards = dict(zip(dataset.throws["trial"].to_pylist(), dataset.throws["shard"].to_pylist(), strict=True))
    for comparison in replay_throws(dataset.directory, select_trials(dataset, sample=count)):
        if comparison.differences:
            problem = f"comes out differently: {'; '.join(comparison.differences)}"
            yield Finding(shards[comparison.trial], f"trial {comparison.trial}", problem)


def _find_different_frames(dataset: Dataset, count: int) -> Iterator[Finding]:
    """Find throws of which sensors have recorded something else than what they see of the recorded samples."""
    trials = select_trials(dataset, sample=min(count, len(dataset.recorded)))
    found = _work_on(dataset.directory, trials, _begin_rendering, "renders", "rendered")
    for trial, names in zip(trials, found, strict=True):
        if names:
            problem = f"has other frames of {join_names(names)} than its samples give"
            yield Finding(str(dataset.throw(trial)["shard"]), f"trial {trial}", problem)


def _begin_rendering(directory: Path) -> Callable[[int], list[str]]:
    """Open a dataset in a process; the function names the sensors that see something else in a trial."""
    dataset = Dataset.open(directory)
    channels = Channels(dataset.config, full_description(dataset.config))
    recorder = SensorRecorder(channels)
    names = {max(topics): name for name, topics in channels.sensors.items()}

    def render(number: int) -> list[str]:
        throw = dataset.throw(number)
        with throw.locating_damage():
            stored = throw.read_episode(sensors=True)
            again = recorder.record(throw.config, stored.header.trial, stored.samples())
            pairs = zip(stored.sensors, again, strict=False)
            wrong = {max(one.indexes) for one, other in pairs if one.records_sha256 != other.records_sha256}
        return [names[number] for number in sorted(wrong)]

    return render
