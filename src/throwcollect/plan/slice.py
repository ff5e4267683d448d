"""Slices of a plan: whole shards of it, so that each can be collected anywhere with the same bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass

from throwcollect.errors import ConfigError, Problem


@dataclass(frozen=True)
class Slice:
    """One of several slices, which together are the plan, in order; written as ``INDEX/COUNT``.

    Attributes:
        index: Place of the slice among all slices, from 0.
        count: Number of slices.
    """

    index: int
    count: int

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    @classmethod
    def parse(cls, text: str) -> Slice:
        """Read the text of a slice."""
        match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text, re.ASCII)
        if match is None:
            raise ConfigError(f"a slice is INDEX/COUNT, got {text!r}", expected="such as 0/8, the first of eight")
        index, count = int(match[1]), int(match[2])
        if index >= count:
            last = f"0/{count} to {count - 1}/{count}" if count else "COUNT to be 1 or more"
            raise ConfigError(f"there is no slice {text}", expected=last)
        return cls(index, count)

    @classmethod
    def all_of(cls, count: int) -> tuple[Slice, ...]:
        """List the slices of a plan that is cut into `count` slices."""
        return tuple(cls(index, count) for index in range(count))

    def trials_of(self, trials: int, *, trials_per_shard: int) -> range:
        """Find the numbers of the slice's trials in a plan of `trials`; slices differ by at most one shard."""
        shards = -(-trials // trials_per_shard)
        if self.count > shards:
            problem = f"{trials} trials are {shards} shards of {trials_per_shard}, fewer than {self.count} slices"
            raise ConfigError([Problem(problem, key="record.trials_per_shard")], expected=f"at most {shards} slices")
        first, last = (shards * bound // self.count for bound in (self.index, self.index + 1))
        return range(first * trials_per_shard, min(last * trials_per_shard, trials))
