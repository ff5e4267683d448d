"""How a model hits: results of throwing at targets in simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field, FiniteFloat

from throwcollect.dataset.misses import find_median, find_share90
from throwcollect.learning.adapting import Method
from throwcollect.learning.polynomial import Array, ModelEntry
from throwcollect.units import format_distance, unit_of_name
from throwcollect.wording import format_count

SCORE_HEAD = ("median", "9 of 10 below", "largest", "throws", "did not succeed")
"""Head of the table of a score, without the column of labels."""


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
    def of(cls, seeds: Sequence[Array], targets: Sequence[str]) -> Errors:
        """Sum up how far throws ended from their targets: medians of the misses of each seed, and all throws.

        Args:
            seeds: For each seed, ends minus targets of at least one throw, shape ``(n, n_targets)``, NaN where it did
                not succeed.
            targets: Names of the targets, which end with their units.
        """
        units = np.array([unit_of_name(target) for target in targets])
        first, *others = (_sum_up([away[:, units == unit] for away in seeds], unit) for unit in list_units(targets))
        away = np.concatenate(seeds)
        missed = int((~np.isfinite(away).all(axis=1)).sum())
        return cls(throws=len(away), missed=missed, **vars(first), others=others)


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


def _sum_up(seeds: Sequence[Array], unit: str) -> MissStatistics:
    # A throw that did not succeed has no distance, and counts as farther away than all others.
    misses = [np.nan_to_num(np.linalg.norm(away, axis=1), nan=np.inf, posinf=np.inf) for away in seeds]
    numbers = [(find_median(each), find_share90(each), float(each.max())) for each in misses]
    # None counts as larger than all numbers.
    median, share90, largest = (
        find_median([np.inf if each is None else each for each in column]) for column in zip(*numbers, strict=True)
    )
    return MissStatistics(unit=unit, median=median, share90=share90, largest=largest)


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


class PolicyScore(ModelEntry):
    """How a policy hits in one world, in simulation.

    Attributes:
        world: The world.
        hits: Share of throws that succeeded and ended at most `hit` from their target, in its unit.
        clipped: Share of their samples in which a command was beyond a limit.
        errors: By how much the targets are missed; medians over seeds.
    """

    world: str
    hit: FiniteFloat
    hits: FiniteFloat
    clipped: FiniteFloat
    errors: Errors
