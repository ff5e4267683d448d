"""Trials of a plan: points of a parameter space in columns, from which single trials are made on demand."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.task_config import is_target


@dataclass(frozen=True, eq=False)
class Points:
    """Values of the swept keys, and places where trials should end, on which no simulation depends; one row per trial.

    Attributes:
        names: Dotted configuration keys, then columns of targets that the task declares, ``(n_columns,)``.
        table: In the units of the names, NaN where a trial has no target, shape ``(n_trials, n_columns)``.
    """

    names: tuple[str, ...]
    table: NDArray[np.float64]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Points):
            return NotImplemented
        return self.names == other.names and np.array_equal(self.table, other.table, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]

    def __len__(self) -> int:
        return len(self.table)

    def __getitem__(self, rows: slice) -> Points:
        return Points(self.names, self.table[rows])

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """Dotted configuration keys, ``(n_keys,)``."""
        return tuple(name for name in self.names if not is_target(name))

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the keys, shape ``(n_trials, n_keys)``."""
        return self.table[:, : len(self.keys)]

    @cached_property
    def target_names(self) -> tuple[str, ...]:
        """Columns of targets; empty if no trial has one."""
        return self.names[len(self.keys) :]

    @property
    def targets(self) -> NDArray[np.float64]:
        """Places where the trials should end, shape ``(n_trials, n_targets)``."""
        return self.table[:, len(self.keys) :]

    def row(self, number: int) -> tuple[dict[str, float], dict[str, float]]:
        """Return the values of a row by key, and its target by column, without missing numbers."""
        numbers = dict(zip(self.names, self.table[number].tolist(), strict=True))
        target = {name: numbers.pop(name) for name in self.target_names}
        return numbers, {name: value for name, value in target.items() if not math.isnan(value)}


Values = Mapping[str, float]
NO_TARGET: Values = MappingProxyType({})

DIGEST_BYTES = 32
"""Size of a SHA-256 [bytes]."""


@dataclass(frozen=True)
class Trial:
    """One numbered point of the sweep.

    Attributes:
        number: Number of the trial in its plan, from 0.
        values: Value of each swept dotted key, in the key's unit.
        seed: Seed for anything random in the trial, from the root seed and the number; fits uint64.
        digest: SHA-256 in hex over everything that determines the trial's samples.
        refused: Why the trial is not run; None if it is run.
        target: Place where the trial should end, by column; empty if it has none. The simulation does not depend on it.
    """

    number: int
    values: Mapping[str, float]
    seed: int
    digest: str
    refused: str | None = None
    target: Mapping[str, float] = field(default_factory=dict)


@dataclass(eq=False, repr=False)
class Trials(Sequence[Trial]):
    """Trials in order and without gaps.

    Attributes:
        points: Values and targets of the trials.
        seeds: Seed of each trial, shape ``(n_trials,)``.
        digests: Digest of each trial, shape ``(n_trials, DIGEST_BYTES)``.
        first: Number of the first trial.
        refused: Reasons of the trials that are not run, by their numbers and in their order.
    """

    points: Points
    seeds: NDArray[np.uint64]
    digests: NDArray[np.uint8]
    first: int = 0
    refused: dict[int, str] = field(default_factory=dict)

    @property
    def numbers(self) -> range:
        """Numbers of the trials."""
        return range(self.first, self.first + len(self))

    @property
    def numbers_to_run(self) -> Iterator[int]:
        """Numbers of the trials that are not refused, in order."""
        return (number for number in self.numbers if number not in self.refused)

    def __len__(self) -> int:
        return len(self.seeds)

    @overload
    def __getitem__(self, which: int) -> Trial: ...
    @overload
    def __getitem__(self, which: slice) -> Trials: ...
    def __getitem__(self, which: int | slice) -> Trial | Trials:
        """Return the trial at a position, or the trials of a Python slice without gaps."""
        # A range takes negative positions and slices, and raises the IndexError.
        chosen = self.numbers[which]
        if isinstance(chosen, int):
            return self._make_trial(chosen)
        if chosen.step != 1:
            raise ValueError(f"trials have no gaps: {which}")
        rows = slice(chosen.start - self.first, chosen.stop - self.first)
        refused = {number: self.refused[number] for number in chosen if number in self.refused}
        return Trials(self.points[rows], self.seeds[rows], self.digests[rows], first=chosen.start, refused=refused)

    def __iter__(self) -> Iterator[Trial]:
        return map(self._make_trial, self.numbers)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Trials):
            return NotImplemented
        return (
            self.points == other.points
            and self.first == other.first
            and self.refused == other.refused
            and np.array_equal(self.seeds, other.seeds)
            and np.array_equal(self.digests, other.digests)
        )

    __hash__ = None  # type: ignore[assignment]

    def _make_trial(self, number: int) -> Trial:
        row = number - self.first
        values, target = self.points.row(row)
        digest = self.digests[row].tobytes().hex()
        return Trial(number, values, int(self.seeds[row]), digest, self.refused.get(number), target)


def choose_trials(trials: Sequence[int], *, count: int, seed: int) -> list[int]:
    """Choose at most `count` of the trials, by the root seed of the collection, and keep their order."""
    if count >= len(trials):
        return list(trials)
    picked = np.random.default_rng(seed).choice(len(trials), size=count, replace=False)
    return [trials[index] for index in sorted(picked.tolist())]
