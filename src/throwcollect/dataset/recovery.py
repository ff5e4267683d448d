"""Takes in what an interrupted collection has left of a shard: every whole episode stays, the rest is run again.

Whatever happened, one of two things holds afterwards. Either the shard's final file is there and is, byte for byte,
what its episodes call for; or all that is left of it lies in the file with the ending ``.part``, to which episodes can
be appended as if nothing had happened.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

from throwcollect.dataset.directory import CARD, CONFIG, MANIFEST, METADATA, PLAN, PROVENANCE, SOURCES, THROWS, TRIALS
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.mcap_contents import Run
from throwcollect.dataset.mcap_reader import map_file
from throwcollect.dataset.scan import scan_whole
from throwcollect.dataset.shard import FinishedShard, OpenShard, path_of_part, write_in_order
from throwcollect.episode.channels import Channels
from throwcollect.errors import DatasetError
from throwcollect.files import is_there, remove, unwritable
from throwcollect.side_by_side import work_side_by_side
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.result import Result

_MANY_EPISODES = 1000
"""From here on, looking through files side by side is worth the start of processes."""


@dataclass(frozen=True)
class RecoveredEpisode:
    """A complete episode that was found on disk, so that its trial need not be run again.

    Attributes:
        trial: Number of its trial.
        samples: Number of its samples.
        digest: Its digest.
        result: What came of it.
    """

    trial: int
    samples: int
    digest: str
    result: Result


@dataclass(frozen=True)
class RecoveredShard:
    """What was left of a shard.

    Attributes:
        episodes: In order of trials.
        finished: The shard, if its final file stays; else None, and it goes on as an open one.
    """

    episodes: tuple[RecoveredEpisode, ...]
    finished: FinishedShard | None


@dataclass(frozen=True)
class _Found:
    """A whole episode, and where it lies in its file."""

    episode: RecoveredEpisode
    offset: int
    run: Run


@dataclass(frozen=True)
class LeftOfShard:
    """Episodes of a shard that are as they would be if they were collected again, by trial.

    Attributes:
        final: Those in its final file.
        begun: Those in the file that it is filled in; not looked for if the final file stays.
        finished: The final file, if it is, byte for byte, what its episodes call for and has all that are wanted.
    """

    final: Mapping[int, _Found]
    begun: Mapping[int, _Found]
    finished: FinishedShard | None


@dataclass(frozen=True)
class Part:
    """A shard of which something may be left.

    Attributes:
        path: Its final path.
        plan: Its trials; those that are not refused are waited for.
        settled: Whether no trial will be added to it, so that its final file may stay if it has an episode of each.
    """

    path: Path
    plan: Plan
    settled: bool


def remove_unfinished(directory: Path) -> None:
    """Remove what is left of files beside the recordings whose writer was killed; the files themselves stay.

    Raises:
        DatasetError: If something cannot be removed.
    """
    for name in (CONFIG, PLAN, TRIALS, SOURCES, THROWS, CARD, PROVENANCE, MANIFEST, METADATA):
        remove(directory / f"{name}.new")
    # So were plans called by earlier versions.
    remove(directory / f"{PLAN}.part")


def find_left(parts: Sequence[Part], channels: Channels, *, processes: int = 1) -> Iterator[LeftOfShard]:
    """Look for what is left of shards, in several of them at a time if there is much to look through.

    Args:
        parts: The shards. Nothing is changed.
        channels: What is recorded.
        processes: How many processes may look; more than one import the program that calls this, as those of
            `multiprocessing` do.

    Yields:
        What is left of each, in order.

    Raises:
        DatasetError: If files cannot be read.
        WorkerError: If a process that looks is killed.
    """
    there = [is_there(part.path) or is_there(path_of_part(part.path)) for part in parts]
    # Every process gets the trials that it needs, and not a whole plan.
    pieces = [*compress(parts, there)]
    if sum(len(piece.plan.trials) for piece in pieces) < _MANY_EPISODES:
        processes = 1
    found = work_side_by_side(
        pieces, _look_with, (channels,), processes=processes, doing="looks through recordings", fork=True
    )
    for is_here in there:
        yield next(found) if is_here else LeftOfShard({}, {}, None)


def _look_with(channels: Channels) -> Callable[[Part], LeftOfShard]:
    def look(part: Part) -> LeftOfShard:
        wanted = frozenset(part.plan.trials.numbers_to_run)
        final = _find_episodes(part.path, part.plan, channels, wanted)
        if part.settled and final and final.keys() == wanted:
            finished = _check_finished(part.path, channels, final)
            if finished is not None:
                return LeftOfShard(final, {}, finished)
        return LeftOfShard(final, _find_episodes(path_of_part(part.path), part.plan, channels, wanted), None)

    return look


def recover_shard(shard: OpenShard, left: LeftOfShard) -> RecoveredShard:
    """Take in what is left of a shard.

    Args:
        shard: Waits for all its trials; those whose episodes are there are not missing any more when this returns.
        left: What is left of it.

    Raises:
        DatasetError: If files cannot be read or written.
    """
    remove(shard.path.with_name(f"{shard.path.name}.new"))
    final, begun = dict(left.final), dict(left.begun)
    if left.finished is not None:
        remove(shard.part)
        return RecoveredShard(_sort(final.values()), left.finished)
    if final and not begun:
        try:
            os.replace(shard.path, shard.part)
        except OSError as error:
            raise unwritable(shard.part, error) from error
        final, begun = {}, final
    if not begun:
        remove(shard.part)
    else:
        runs = [(trial, found.offset, found.run) for trial, found in begun.items()]
        shard.adopt(runs, size=max(offset + run.length for _, offset, run in runs))
    begun |= _append_moved(shard, {trial: found for trial, found in final.items() if trial not in begun})
    remove(shard.path)
    return RecoveredShard(_sort(begun.values()), None)


def _find_episodes(path: Path, plan: Plan, channels: Channels, wanted: Collection[int]) -> dict[int, _Found]:
    """Episodes of a file that are as they would be if they were collected again, by trial."""
    found: dict[int, _Found] = {}
    if not is_there(path):
        return found
    for each in scan_whole(path):
        episode = each.stored.episode
        trial = episode.header.trial
        if not each.intact or trial not in wanted or trial in found:
            continue
        try:
            result = judge_episode(plan.config_of(plan.trial(trial)), episode)
        except DatasetError:
            continue
        if channels.fit(episode.channels()) and episode.header.start_ns == plan.config.trial_start_ns(trial):
            recovered = RecoveredEpisode(trial, episode.header.samples, episode.digest, result)
            found[trial] = _Found(recovered, each.stored.offset, replace(each.stored.intact_run, data=b""))
    return found


def _check_finished(path: Path, channels: Channels, found: Mapping[int, _Found]) -> FinishedShard | None:
    """The shard that a file is; None if it is not what its episodes call for."""
    written = 0
    same = True
    with map_file(path) as contents:

        def compare(data: bytes) -> None:
            nonlocal written, same
            same = same and contents.slice(written, written + len(data)) == data
            written += len(data)

        def read(offset: int, length: int) -> bytes:
            return contents.slice(offset, offset + length)

        runs = {trial: (each.offset, each.run) for trial, each in found.items()}
        finished = write_in_order(compare, channels, runs, read, name=path.name)
        return finished if same and written == len(contents) else None


def _append_moved(shard: OpenShard, found: Mapping[int, _Found]) -> dict[int, _Found]:
    """Append episodes of the shard's final file to the unfinished one."""
    if found:
        with map_file(shard.path) as contents:
            for each in found.values():
                shard.append(contents.episode(each.offset).episode)
    return dict(found)


def _sort(found: Iterable[_Found]) -> tuple[RecoveredEpisode, ...]:
    return tuple(sorted((each.episode for each in found), key=lambda each: each.trial))
