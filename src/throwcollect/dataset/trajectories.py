"""Trajectories of many throws in arrays: one array for each column, throws one after the other."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.mcap_reader import EpisodePlace
from throwcollect.dataset.trajectory_columns import COLUMNS, Column, empty_columns, fill
from throwcollect.errors import ConfigError
from throwcollect.wording import format_count, suggest

_BLOCK = 16
"""Throws that are read at once: enough to be worth an array, few enough for the caches."""
_MOST_THREADS = 4
"""More are of no use, as part of the work holds the lock of the interpreter."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectories:
    """Trajectories of many throws, one after the other.

    ``trajectories["ball_position"]`` is the column of all throws, ``trajectories[i]`` all columns of one, as views.

    Attributes:
        trials: Numbers of the trials, shape ``(n_throws,)``.
        offsets: Throw i has the samples from ``offsets[i]`` to ``offsets[i + 1]``, not included; shape
            ``(n_throws + 1,)``. A trial without an episode has none.
        columns: Arrays of shape ``(n_samples,)`` or ``(n_samples, n)``, by name.
        joints: Names of the joints that the columns of joints have.
    """

    trials: NDArray[np.int64]
    offsets: NDArray[np.int64]
    columns: Mapping[str, Column]
    joints: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.trials)

    def __repr__(self) -> str:
        size = sum(column.nbytes for column in self.columns.values()) / 1e6
        names = ", ".join(self.columns)
        return f"Trajectories({format_count(len(self), 'throw')}, {self.offsets[-1]} samples, {size:.1f} MB: {names})"

    def __iter__(self) -> Iterator[dict[str, Column]]:
        return (self[number] for number in range(len(self)))

    @overload
    def __getitem__(self, which: str) -> Column: ...
    @overload
    def __getitem__(self, which: int) -> dict[str, Column]: ...
    def __getitem__(self, which: str | int) -> Column | dict[str, Column]:
        """Return a column of all throws by its name, or all columns of one throw by its position.

        Raises:
            KeyError: If the column was not read.
            IndexError: If there is no throw at this position.
            TypeError: If it is neither.
        """
        if isinstance(which, str):
            return self.columns[which]
        number = range(len(self))[which]
        rows = slice(self.offsets[number], self.offsets[number + 1])
        return {name: column[rows] for name, column in self.columns.items()}

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Number of samples of each throw, shape ``(n_throws,)``."""
        return np.diff(self.offsets)

    def padded(self, column: str, *, fill: float = np.nan) -> NDArray[np.float64]:
        """Copy a column into one shape for all throws: the samples of each, then `fill` up to the longest throw.

        Stamps become floating point numbers, which are off by up to some hundred nanoseconds.

        Returns:
            Shape ``(n_throws, n_longest)`` or ``(n_throws, n_longest, n)``.

        Raises:
            KeyError: If the column was not read.
        """
        values, lengths = self[column], self.lengths
        longest = int(lengths.max(initial=0))
        padded = np.full((len(self), longest, *values.shape[1:]), fill)
        # The chosen places are filled row by row, and in this order the samples lie in `values`.
        padded[np.arange(longest) < lengths[:, np.newaxis]] = values
        return padded


def read_trajectories(
    trials: Sequence[int],
    places: Sequence[EpisodePlace | None],
    columns: Sequence[str],
    known: tuple[str, ...],
    joints: tuple[str, ...],
    *,
    threads: int | None = None,
) -> Trajectories:
    """Read the trajectories of trials, whose episodes lie at these places; None for a trial that has none.

    Episodes have the joints `known`. The other arguments are those of `Dataset.trajectories`.

    Raises:
        ConfigError: If there is no such column.
        DatasetError: If an episode is not where it should be, or its chunk is damaged; its CRC is compared.
    """
    for column in columns:
        if column not in COLUMNS:
            raise ConfigError(f"a trajectory has no column {column!r}{suggest(column, COLUMNS, 'docs/reading.md')}")
    stored = [place for place in places if place is not None]
    offsets = np.zeros(len(places) + 1, np.int64)
    np.cumsum([place.samples if place else 0 for place in places], out=offsets[1:])
    found = empty_columns(columns, int(offsets[-1]), len(joints))
    blocks = [stored[first : first + _BLOCK] for first in range(0, len(stored), _BLOCK)]
    starts = np.cumsum([0, *(sum(place.samples for place in block) for block in blocks)]).tolist()

    def read(block: Sequence[EpisodePlace], start: int, stop: int) -> None:
        fill({name: column[start:stop] for name, column in found.items()}, block, known, joints)

    threads = threads or min(_MOST_THREADS, os.cpu_count() or 1)
    with nullcontext() if threads == 1 else ThreadPoolExecutor(threads) as pool:
        # Decompressing and copying release the lock of the interpreter.
        for _ in (pool.map if pool else map)(read, blocks, starts[:-1], starts[1:]):
            pass
    return Trajectories(np.array(trials, np.int64), offsets, found, joints)
