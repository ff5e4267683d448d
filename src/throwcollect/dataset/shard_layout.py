"""Which trials of a plan each shard has, and where its files lie."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.directory import path_of_part, shard_name
from throwcollect.sweep.plan import Plan


@dataclass
class ShardLayout:
    """The shards of a dataset by their numbers, before and after they are begun."""

    directory: Path
    plan: Plan

    def number_of(self, trial: int) -> int:
        """Find the number of the shard of a trial."""
        return trial // self._trials_per_shard

    def numbers_of(self, trials: range) -> range:
        """Find the numbers of the shards of consecutive trials."""
        return range(self.number_of(trials.start), self.number_of(trials.stop - 1) + 1)

    def members(self, number: int) -> range:
        """Find the numbers of the trials of a shard."""
        size, numbers = self._trials_per_shard, self.plan.trials.numbers
        return range(max(number * size, numbers.start), min((number + 1) * size, numbers.stop))

    def to_run(self, number: int) -> Iterator[int]:
        """Find the numbers of the trials of a shard that are not refused."""
        return (each for each in self.members(number) if each not in self.plan.trials.refused)

    def path(self, number: int) -> Path:
        """Make the path of a shard once it is finished."""
        return self.directory / shard_name(self.plan.config.name, number)

    def has_file(self, number: int) -> bool:
        """Whether a shard was begun."""
        path = self.path(number)
        return path.exists() or path_of_part(path).exists()

    def part(self, number: int) -> tuple[Path, Plan]:
        """Describe a shard for `find_left`, without a look into its files."""
        members, first = self.members(number), self.plan.trials.first
        trials = self.plan.trials[members.start - first : members.stop - first]
        return self.path(number), Plan(self.plan.config, trials)

    @property
    def _trials_per_shard(self) -> int:
        return self.plan.config.record.trials_per_shard
