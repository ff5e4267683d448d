"""How a model hits: results of throwing at targets in simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field, FiniteFloat

from throwcollect.dataset.misses import find_median, find_share90
from throwcollect.learning.adapting import Method
from throwcollect.learning.arrays import Array, ModelEntry
from throwcollect.units import format_distance, unit_of_name
from throwcollect.wording import format_count

SCORE_HEAD = ("median", "9 of 10 below", "largest", "throws", "did not succeed")
"""Head of the table of a score, beside its labels."""


class MissStatistics(ModelEntry):
    """How far throws ended from their targets, over the targets of one unit: a distance [m], an angle [rad].

    Attributes:
        unit: The unit.
        median: Median; None if half of the throws did not succeed, as such a throw counts as farther than all others.
        share90: Nine of ten throws miss by less; None if that depends on a throw that did not succeed.
        largest: Largest miss; None if a throw did not succeed.
    """

    unit: str = "m"
    median: FiniteFloat | None
    share90: FiniteFloat | None
    largest: FiniteFloat | None


class Errors(MissStatistics):
    """Misses over all targets; the fields of `MissStatistics` are those of the first unit, metres if a target has them.

    Attributes:
        throws: Number of throws.
        missed: Number of throws that did not succeed, or were refused.
        others: Misses over the targets of each further unit.
    """

    throws: int
    missed: int
    others: list[MissStatistics] = Field(default=[])

    @property
    def by_unit(self) -> tuple[MissStatistics, ...]:
        """Misses over the targets of each unit."""
        return self, *self.others

    @property
    def cells(self) -> tuple[str, ...]:
        """What `SCORE_HEAD` names, for people; misses are those of all units."""
        misses = (
            ", ".join(dict.fromkeys(format_distance(getattr(each, name), each.unit) for each in self.by_unit))
            for name in ("median", "share90", "largest")
        )
        return (*misses, str(self.throws), str(self.missed))

    @classmethod
    def of(cls, away: Array, targets: Sequence[str]) -> Errors:
        """Sum up how far throws ended from their targets.

        Args:
            away: Ends minus targets of at least one throw, NaN if it did not succeed; shape ``(n, n_targets)``.
            targets: Names of the targets, which tell their units.
        """
        units = np.array([unit_of_name(target) for target in targets])
        first, *others = (_sum_up(away[:, units == unit], unit) for unit in list_units(targets))
        missed = int((~np.isfinite(away).all(axis=1)).sum())
        return cls(throws=len(away), missed=missed, **vars(first), others=others)

    @classmethod
    def middle(cls, some: Sequence[Errors]) -> Errors:
        """Sum up the errors of several seeds, at least one: the medians of their misses, and all their throws."""
        first, *others = (_take_middle(each) for each in zip(*(each.by_unit for each in some), strict=True))
        throws, missed = sum(each.throws for each in some), sum(each.missed for each in some)
        return cls(throws=throws, missed=missed, **vars(first), others=others)


def list_units(targets: Sequence[str]) -> list[str]:
    """Units of targets, each once: metres first, the others in order."""
    units = dict.fromkeys(unit_of_name(target) for target in targets)
    return sorted(units, key=lambda unit: unit != "m")


def format_length(length: float | None, targets: Sequence[str]) -> str:
    """Write a distance over all targets for people, whatever their units."""
    units = list_units(targets)
    if len(units) == 1 or length is None:
        return format_distance(length, units[0])
    return f"{length:.3g} ({' and '.join(units)} together)"


def format_scatter(scatter: float, targets: Sequence[str]) -> str:
    """Write a standard deviation that every target has for people."""
    return " and ".join(format_distance(scatter, unit) for unit in list_units(targets))


def _sum_up(away: Array, unit: str) -> MissStatistics:
    distances = np.linalg.norm(away, axis=1)
    # A throw that did not succeed has no distance, and counts as farther away than all others.
    misses = np.where(np.isfinite(distances), distances, np.inf)
    largest = float(misses.max())
    return MissStatistics(
        unit=unit,
        median=find_median(misses),
        share90=find_share90(misses),
        largest=largest if np.isfinite(largest) else None,
    )


def _take_middle(some: Sequence[MissStatistics]) -> MissStatistics:
    median, share90, largest = (
        # None counts as larger than all numbers.
        find_median([np.inf if (value := getattr(each, name)) is None else value for each in some])
        for name in ("median", "share90", "largest")
    )
    return MissStatistics(unit=some[0].unit, median=median, share90=share90, largest=largest)


class Trained(ModelEntry):
    """How a model of some throws of the dataset hits.

    Attributes:
        trained_on: Number of throws that it was learned from.
        errors: By how much the targets are missed.
    """

    trained_on: int
    errors: Errors


class Adapted(ModelEntry):
    """How a model hits in another world after some throws there.

    Attributes:
        real_throws: Number of these throws.
        method: How the world was taken to differ.
        errors: By how much the targets are missed.
    """

    real_throws: int
    method: Method
    errors: Errors


class ThrowAtTarget(ModelEntry):
    """A throw at a target.

    Attributes:
        target: Where it should end.
        place: Where it ended; None if it did not succeed.
    """

    target: list[FiniteFloat]
    place: list[FiniteFloat] | None


class Score(ModelEntry):
    """All results of a model; all numbers are from simulation.

    Attributes:
        targets: Number of targets of each seed.
        seed: The first seed of their choice.
        seeds: Number of seeds; all misses are medians over them.
        trained: By the number of throws that a model was learned from; the model itself comes last.
        distilled: How the distilled map hits; None if the model was not distilled.
        throws: Throws of the model itself.
        scatter: Noise on the measured ends of throws in the other world, in the unit of the targets.
        adapted: By the number of throws in the other world; empty if there was none.
        adapted_throws: Throws at targets in the other world, by the model that was adapted by the most throws.
    """

    format: Literal["1"] = "1"
    targets: int
    seed: int
    seeds: int = 1
    trained: list[Trained]
    distilled: Errors | None = None
    throws: list[ThrowAtTarget] = Field(repr=False)
    scatter: FiniteFloat
    adapted: list[Adapted]
    adapted_throws: list[ThrowAtTarget] = Field(repr=False)

    def list_rows(self) -> list[tuple[str, ...]]:
        """Make the table of all results, for people: which model threw, and what `SCORE_HEAD` names.

        The last ones, as many as `adapted`, are those in the other world.
        """
        rows = [(f"learned from {each.trained_on:,} throws", *each.errors.cells) for each in self.trained]
        if self.distilled is not None:
            rows.append(("model.onnx of these", *self.distilled.cells))
        for each in self.adapted:
            after = f"after {format_count(each.real_throws, 'throw')} ({each.method.value})"
            rows.append((f"in the other world {after}", *each.errors.cells))
        return rows


def pool_scores(scores: Sequence[Score]) -> Score:
    """Put the scores of several seeds together, at least one."""
    first = scores[0]
    sizes = [each.trained_on for each in first.trained]
    numbers = sorted({each.real_throws for score in scores for each in score.adapted})
    there = [each for score in scores for each in score.adapted]
    distilled = [score.distilled for score in scores if score.distilled is not None]
    return first.model_copy(
        update={
            "seeds": len(scores),
            "trained": [
                Trained(trained_on=size, errors=Errors.middle([score.trained[at].errors for score in scores]))
                for at, size in enumerate(sizes)
            ],
            "distilled": Errors.middle(distilled) if distilled else None,
            "throws": [throw for score in scores for throw in score.throws],
            "adapted": [_pool_adapted([each for each in there if each.real_throws == number]) for number in numbers],
            "adapted_throws": [throw for score in scores for throw in score.adapted_throws],
        }
    )


def _pool_adapted(some: Sequence[Adapted]) -> Adapted:
    """Pool results of several seeds: the method that most of them chose, and the errors of all."""
    methods = [each.method for each in some]
    method = max(methods, key=methods.count)
    return Adapted(real_throws=some[0].real_throws, method=method, errors=Errors.middle([each.errors for each in some]))
