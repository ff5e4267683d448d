"""What throwing at targets in simulation has shown of a model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, FiniteFloat

from throwcollect.learning.adapting import Method

Array = NDArray[np.float64]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Errors(_Entry):
    """Distances of throws from their targets, in the unit of the targets.

    Attributes:
        throws: Number of throws.
        missed: Number of those that did not succeed, or were refused; they count as farther than all others.
        median: Median; None if half of them did not succeed, and likewise below.
        share90: What nine of ten throws stay below.
        largest: Largest.
    """

    throws: int
    missed: int
    median: FiniteFloat | None
    share90: FiniteFloat | None
    largest: FiniteFloat | None

    @classmethod
    def of(cls, errors: Array) -> Errors:
        """Sum up distances, which are infinite where a throw did not succeed; there is at least one."""
        ordered = np.sort(errors)
        places = (len(ordered) - 1) // 2, int(np.ceil(0.9 * len(ordered))) - 1, len(ordered) - 1
        median, share90, largest = (float(ordered[place]) if np.isfinite(ordered[place]) else None for place in places)
        missed = int((~np.isfinite(errors)).sum())
        return cls(throws=len(errors), missed=missed, median=median, share90=share90, largest=largest)

    @classmethod
    def middle(cls, some: Sequence[Errors]) -> Errors:
        """Sum up those of several seeds: each number is the median of theirs; there is at least one."""
        lists = ([each.median for each in some], [each.share90 for each in some], [each.largest for each in some])
        median, share90, largest = (
            sorted(values, key=lambda value: (value is None, value))[(len(values) - 1) // 2] for values in lists
        )
        throws, missed = sum(each.throws for each in some), sum(each.missed for each in some)
        return cls(throws=throws, missed=missed, median=median, share90=share90, largest=largest)


class Trained(_Entry):
    """How a model of some throws of the dataset hits.

    Attributes:
        trained_on: Number of throws that it was learned from.
        errors: Distances from the targets.
    """

    trained_on: int
    errors: Errors


class Adapted(_Entry):
    """How a model hits in another world after some throws there.

    Attributes:
        real_throws: Number of these throws.
        method: What the world was taken to differ by.
        errors: Distances from the targets.
    """

    real_throws: int
    method: Method
    errors: Errors


class ThrowAtTarget(_Entry):
    """A throw at a target.

    Attributes:
        target: Where to.
        place: Where it ended; None if it did not succeed.
    """

    target: list[FiniteFloat]
    place: list[FiniteFloat] | None


class Score(_Entry):
    """All of it; every number is one "in simulation".

    Attributes:
        targets: Number of targets of each seed.
        seed: The first seed of their choice.
        seeds: Number of seeds; numbers are medians of theirs.
        trained: By the number of throws that a model was learned from; the model itself comes last.
        throws: Its throws.
        scatter: Noise on what was measured of throws in the other world, in the unit of the targets.
        adapted: By the number of throws in the other world; empty if there was none.
        adapted_throws: Throws in the other world after the most of them.
    """

    format: Literal["1"] = "1"
    targets: int
    seed: int
    seeds: int = 1
    trained: list[Trained]
    throws: list[ThrowAtTarget]
    scatter: FiniteFloat
    adapted: list[Adapted]
    adapted_throws: list[ThrowAtTarget]


def pool_scores(scores: Sequence[Score]) -> Score:
    """Put the scores of several seeds together.

    Args:
        scores: One for each seed, at least one.
    """
    first = scores[0]
    sizes = [each.trained_on for each in first.trained]
    numbers = sorted({each.real_throws for score in scores for each in score.adapted})
    there = [each for score in scores for each in score.adapted]
    return first.model_copy(
        update={
            "seeds": len(scores),
            "trained": [
                Trained(trained_on=size, errors=Errors.middle([score.trained[at].errors for score in scores]))
                for at, size in enumerate(sizes)
            ],
            "throws": [throw for score in scores for throw in score.throws],
            "adapted": [_pool_adapted([each for each in there if each.real_throws == number]) for number in numbers],
            "adapted_throws": [throw for score in scores for throw in score.adapted_throws],
        }
    )


def _pool_adapted(some: Sequence[Adapted]) -> Adapted:
    """What most seeds took the world to differ by, and their errors."""
    methods = [each.method for each in some]
    method = max(methods, key=methods.count)
    return Adapted(real_throws=some[0].real_throws, method=method, errors=Errors.middle([each.errors for each in some]))
