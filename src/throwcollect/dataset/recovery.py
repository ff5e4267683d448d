"""Takes in what an interrupted collection left of a shard: every whole episode stays, the other trials run again.

Afterwards, one of two things holds. Either the shard's final file is there and is, byte for byte, what the writer makes
of its episodes; or all that is left of it lies in the file with the ending ``.part``, to which the writer can append as
if it had never stopped.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

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
from throwcollect.dataset.mcap_file import RecordGroup
from throwcollect.dataset.mcap_reader import open_mcap, scan_file
from throwcollect.dataset.shard import FinishedShard, OpenShard, rewrite
from throwcollect.dataset.throws_table import Row, judge_episode, place_columns
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import count_indexed
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import DatasetError
from throwcollect.files import remove, unwritable
from throwcollect.plan.plan import Plan
from throwcollect.side_by_side import work_side_by_side
from throwcollect.tasks.result import Result

_MANY_EPISODES = 1000
"""From this number of episodes on, starting processes that look through files side by side saves time."""


class RecoveredEpisode(NamedTuple):
    """A whole episode on disk, so that its trial need not run again.

    It lies at `place` now, in columns of the table. `run` has its records without their bytes.
    """

    result: Result
    place: Row
    run: RecordGroup


@dataclass(frozen=True)
class LeftOfShard:
    """What is left of a shard: a file, and the episodes in it that stay, by trial.

    Attributes:
        path: The final or the unfinished file of the shard, whichever has more episodes.
        episodes: The episodes.
        finished: The final file, if it has an episode of every trial and is, byte for byte, what the writer makes of
            these; else None, and the shard is filled further.
    """

    path: Path
    episodes: Mapping[int, RecoveredEpisode]
    finished: FinishedShard | None


def remove_unfinished(directory: Path) -> None:
    """Remove half-written files that a killed process left next to the recordings; the files themselves stay."""
    for name in (CONFIG, PLAN, TRIALS, MOTIONS, SOURCES, THROWS, CARD, PROVENANCE, MANIFEST, METADATA):
        remove(directory / f"{name}.new")
    for path in (directory / BODIES).glob("*.new"):
        remove(path)


def find_left(parts: Sequence[tuple[Path, Plan]], channels: Channels, *, processes: int = 1) -> Iterator[LeftOfShard]:
    """Look for what is left of shards, given by final path and trials, side by side if there are many. Changes nothing.

    Yields:
        What is left of each, in order.
    """
    if sum(len(plan.trials) for _, plan in parts) < _MANY_EPISODES:
        processes = 1
    return work_side_by_side(
        parts, _look_with, (channels,), processes=processes, doing="looks through recordings", fork=True
    )


def _look_with(channels: Channels) -> Callable[[tuple[Path, Plan]], LeftOfShard]:
    def look(part: tuple[Path, Plan]) -> LeftOfShard:
        path, plan = part
        final = find_episodes(path, plan, channels)
        # Only a file with an episode of each trial can be finished, so others are not compared byte by byte.
        if final and final.keys() == set(plan.trials.numbers_to_run):
            with open_mcap(path) as contents:
                runs = {trial: each.run for trial, each in final.items()}
                finished, difference = rewrite(contents, channels, runs, name=path.name)
            if difference is None:
                return LeftOfShard(path, final, finished)
        unfinished = path_of_part(path)
        begun = find_episodes(unfinished, plan, channels)
        # A process that is killed leaves all episodes in one of the two.
        return LeftOfShard(path, final, None) if len(final) > len(begun) else LeftOfShard(unfinished, begun, None)

    return look


def recover_shard(shard: OpenShard, left: LeftOfShard) -> None:
    """Take in what is left of a shard, which no longer waits for these episodes when this returns."""
    remove(shard.path.with_name(f"{shard.path.name}.new"))
    if left.finished is None and left.path == shard.path and left.episodes:
        # `adopt` cuts off what follows the last episode, so a final file can become the unfinished one as it is.
        try:
            os.replace(shard.path, shard.part)
        except OSError as error:
            raise unwritable(shard.part, error) from error
    elif left.finished is None:
        remove(shard.path)
    if left.finished is not None or not left.episodes:
        remove(shard.part)
    else:
        shard.adopt({trial: each.run for trial, each in left.episodes.items()})


def find_episodes(path: Path, plan: Plan, channels: Channels) -> dict[int, RecoveredEpisode]:
    """Find the whole episodes of trials of a plan that are not refused in a file, by trial; a missing file has none."""
    episodes: dict[int, RecoveredEpisode] = {}
    trials_to_run = frozenset(plan.trials.numbers_to_run)
    for episode, run in scan_file(path):
        trial = episode.header.trial
        if trial in trials_to_run and trial not in episodes:
            with suppress(DatasetError):
                config = plan.config_of(plan.trial(trial))
                check_recorded(config, episode, channels)
                place = place_columns(path.name, run.offset, episode)
                episodes[trial] = RecoveredEpisode(judge_episode(config, episode), place, run)
    return episodes


def check_recorded(config: Config, episode: Episode, channels: Channels) -> None:
    """Check that an episode has what is recorded of a trial with this configuration, at the time of this trial."""
    if (found := tuple(episode.table.columns)) != channels.numbers:
        raise DatasetError(f"has the channels {list(found)} instead of {list(channels.numbers)}")
    frames, wanted = Counter[int](), Counter[int]()
    for chunk in episode.sensors:
        frames.update({number: count_indexed(index) for number, index in chunk.indexes.items()})
    for name, topics in channels.sensors.items():
        stride = config.record.rate_hz // config.sensors[name].rate_hz
        wanted.update(dict.fromkeys(topics, len(range(0, episode.header.samples, stride))))
    if frames != wanted:
        raise DatasetError(f"has {dict(frames)} frames on channels of sensors instead of {dict(wanted)}")
    if (start_ns := config.trial_start_ns(episode.header.trial)) != episode.header.start_ns:
        raise DatasetError(f"starts at {episode.header.start_ns} ns, the trial's slot of time at {start_ns} ns")
