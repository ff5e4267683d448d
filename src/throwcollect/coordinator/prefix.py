"""Decides which trials of a plan certainly belong to the dataset, if that ends when enough trials have succeeded."""

from __future__ import annotations

import math
from collections.abc import Collection

_OPEN, _SUCCEEDED, _FAILED = range(3)


class Prefix:
    """The first trials of a plan, up to the one at which enough trials have succeeded.

    A trial certainly belongs to the dataset if fewer than `wanted` of the trials before it have succeeded or may still
    succeed. Only such trials are run. So nothing runs that is not written, and the last trial depends neither on
    the number of simulations nor on the order in which results arrive.

    Args:
        numbers: Numbers of all trials of the plan.
        wanted: How many trials have to succeed; None if all trials belong to the dataset.
        refused: Trials that are known not to be run.
    """

    def __init__(self, numbers: range, *, wanted: int | None, refused: Collection[int]) -> None:
        self._first = numbers.start
        self._states = bytearray(len(numbers))
        for trial in refused:
            self._states[trial - self._first] = _FAILED
        self._wanted = math.inf if wanted is None else wanted
        self._count = 0
        """Number of trials that certainly belong to the dataset."""
        self._open = 0
        """How many of these have not ended yet."""
        self._possible = 0
        """How many of these have succeeded or may still succeed."""
        self._advance()

    @property
    def stop(self) -> int:
        """Number of the first trial that does not certainly belong to the dataset; it never gets smaller."""
        return self._first + self._count

    @property
    def complete(self) -> bool:
        """Whether all trials that certainly belong to the dataset have ended; then no other trial belongs to it."""
        return not self._open

    def end(self, trial: int, *, succeeded: bool) -> None:
        """Note how a trial has ended, or that it is refused; a second call for the same trial changes nothing."""
        place = trial - self._first
        if self._states[place] != _OPEN:
            return
        self._states[place] = _SUCCEEDED if succeeded else _FAILED
        if place < self._count:
            self._open -= 1
            self._possible -= not succeeded
            self._advance()

    def _advance(self) -> None:
        while self._possible < self._wanted and self._count < len(self._states):
            self._open += self._states[self._count] == _OPEN
            self._possible += self._states[self._count] != _FAILED
            self._count += 1
