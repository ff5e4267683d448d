"""Takes in what an interrupted collection left of a shard: every whole episode stays, the other trials run again.

Afterwards, one of two things holds. Either the shard's final file is there and is, byte for byte, what the writer makes
of its episodes; or all that is left of it lies in the file with the ending ``.part``, to which the writer can append as
if it had never stopped.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from throwcollect.config.schema import BODIES, MOTIONS, Config
from throwcollect.dataset.directory import (
    CARD,
    CONFIG,
    MANIFEST,
    METADATA,
    PLAN,
    PROVENANCE,
    SOURCES,
    THROWS,
    TRIALS,
    path_of_part,
)
from throwcollect.dataset.judging import judge_episode
from throwcollect.dataset.mcap_file import RecordGroup
from throwcollect.dataset.mcap_reader import map_file, scan_file
from throwcollect.dataset.shard import FinishedShard, OpenShard, rewrite
from throwcollect.dataset.throws_table import Row, place_columns
from throwcollect.episode.channels import Channels
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.files import remove, unwritable
from throwcollect.side_by_side import work_side_by_side
from throwcollect.sweep.plan import Plan
from throwcollect.tasks.result import Result

Judge = Callable[[Config, Episode], Result]

_MANY_EPISODES = 1000
"""From this number of episodes on, starting processes that look through files side by side saves time."""


@dataclass(frozen=True)
class RecoveredEpisode:
    """An episode on disk that is as a new simulation of its trial would record it, so the trial need not run again.

    It lies at `place` now, in columns of the table. `run` has its records without their bytes; None if they are not
    byte for byte what the writer writes, so that the episode has to be written anew.
    """

    trial: int
    result: Result
    place: Row
    run: RecordGroup | None


@dataclass(frozen=True)
class LeftOfShard:
    """The episodes that are left of a shard, by trial.

    Attributes:
        final: Episodes in its final file.
        begun: Episodes in its unfinished file; not looked for if the final file stays.
        finished: The final file, if it has an episode of every trial and is, byte for byte, what the writer makes of
            these; else None, and the shard is filled further.
    """

    final: Mapping[int, RecoveredEpisode]
    begun: Mapping[int, RecoveredEpisode]
    finished: FinishedShard | None

    def without(self, dropped: Collection[int]) -> LeftOfShard:
        """Leave out the episodes of some trials, which are of no use any more."""
        if not dropped:
            return self
        final, begun = (
            {trial: found for trial, found in episodes.items() if trial not in dropped}
            for episodes in (self.final, self.begun)
        )
        return LeftOfShard(final, begun, None)


def remove_unfinished(directory: Path) -> None:
    """Remove half-written files that a killed process left beside the recordings; the files themselves stay."""
    for name in (CONFIG, PLAN, TRIALS, MOTIONS, SOURCES, THROWS, CARD, PROVENANCE, MANIFEST, METADATA):
        remove(directory / f"{name}.new")
    for path in (directory / BODIES).glob("*.new"):
        remove(path)


def find_left(
    parts: Sequence[tuple[Path, Plan]], channels: Channels, *, judge: Judge = judge_episode, processes: int = 1
) -> Iterator[LeftOfShard]:
    """Look for what is left of shards, given by final path and trials, side by side if there are many. Changes nothing.

    Yields:
        What is left of each, in order.
    """
    if sum(len(plan.trials) for _, plan in parts) < _MANY_EPISODES:
        processes = 1
    return work_side_by_side(
        parts, _look_with, (channels, judge), processes=processes, doing="looks through recordings", fork=True
    )


def _look_with(channels: Channels, judge: Judge) -> Callable[[tuple[Path, Plan]], LeftOfShard]:
    def look(part: tuple[Path, Plan]) -> LeftOfShard:
        path, plan = part
        final = find_episodes(path, plan, channels, judge=judge)
        # Only a file with an episode of each trial can be finished, so others are not compared byte by byte.
        if final and final.keys() == set(plan.trials.numbers_to_run):
            finished = _check_finished(path, channels, final)
            if finished is not None:
                return LeftOfShard(final, {}, finished)
        begun = find_episodes(path_of_part(path), plan, channels, judge=judge)
        return LeftOfShard(final, begun, None)

    return look


def recover_shard(shard: OpenShard, left: LeftOfShard) -> list[RecoveredEpisode]:
    """Take in what is left of a shard, which no longer waits for these episodes when this returns.

    Returns:
        The episodes, in order of trials.
    """
    remove(shard.path.with_name(f"{shard.path.name}.new"))
    final, begun = left.final, left.begun
    if left.finished is not None:
        remove(shard.part)
        return [final[trial] for trial in sorted(final)]
    # `adopt` cuts off what follows the last episode, so a final file can become the unfinished one as it is. A file in
    # which an episode has to be written anew becomes the final one, from which all are copied.
    if final and not begun and None not in (each.run for each in final.values()):
        _rename(shard.path, shard.part)
        final, begun = {}, final
    elif begun and not final and None in (each.run for each in begun.values()):
        _rename(shard.part, shard.path)
        final, begun = begun, {}
    # Both files have episodes if an earlier process was killed before it had removed one of them.
    runs = {trial: each.run for trial, each in begun.items() if each.run is not None}
    if runs:
        shard.adopt(runs)
    else:
        remove(shard.part)
    only_final = {each.place["chunk_offset"]: each for trial, each in final.items() if trial not in runs}
    if only_final:
        for found in scan_file(shard.path):
            if found.offset in only_final:
                shard.append(found.episode)
    # The final file goes last: if this process is killed before, the next one finds these episodes in it again.
    remove(shard.path)
    episodes = {**{trial: begun[trial] for trial in runs}, **{each.trial: each for each in only_final.values()}}
    return [episodes[trial] for trial in sorted(episodes)]


def _rename(path: Path, target: Path) -> None:
    try:
        os.replace(path, target)
    except OSError as error:
        raise unwritable(target, error) from error


def find_episodes(
    path: Path, plan: Plan, channels: Channels | None = None, *, judge: Judge = judge_episode
) -> dict[int, RecoveredEpisode]:
    """Find the whole episodes of a file, by trial.

    Args:
        path: The file; if it is missing, it has none.
        plan: The trials; episodes of others, and of refused ones, are left out.
        channels: What is recorded; None if the file is only read, and then channels are not compared.
        judge: Finds the result of an episode of a trial with this configuration.
    """
    episodes: dict[int, RecoveredEpisode] = {}
    trials_to_run = frozenset(plan.trials.numbers_to_run)
    for found in scan_file(path):
        episode = found.episode
        trial = episode.header.trial
        if trial not in trials_to_run or (trial in episodes and episodes[trial].run is not None):
            continue
        try:
            result = judge(plan.config_of(plan.trial(trial)), episode)
        except DatasetError:
            continue
        recorded = channels is None or channels.numbers == tuple(episode.table.columns)
        if recorded and episode.header.start_ns == plan.config.trial_start_ns(trial):
            place = place_columns(path.name, found.offset, episode)
            run = found.run
            if run is not None or trial not in episodes:
                episodes[trial] = RecoveredEpisode(trial, result, place, run)
    return episodes


def _check_finished(path: Path, channels: Channels, episodes: Mapping[int, RecoveredEpisode]) -> FinishedShard | None:
    """Describe a finished file; None if it is not, byte for byte, what the writer makes of its episodes."""
    runs = {trial: each.run for trial, each in episodes.items() if each.run is not None}
    if len(runs) < len(episodes):
        return None
    with map_file(path) as contents:
        finished, difference = rewrite(contents, channels, runs, name=path.name)
    return finished if difference is None else None
