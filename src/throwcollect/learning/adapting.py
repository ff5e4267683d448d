"""Adapting a learned map to another world by a few throws in it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from throwcollect.learning.learned_map import Correction, LearnedMap, Role
from throwcollect.reproducible_math import matmul, solve

Array = NDArray[np.float64]

_OFFSET = 0.1
"""What the place where a trial ends is expected to be off by [m or rad], as a standard deviation."""
_SMALL_OFFSET = 0.02
"""The same where something else explains most of the difference."""
_BIAS = 0.2
"""What a parameter is expected to be off by, scaled: a tenth of its range."""
_LATENT = 0.6
"""Standard deviation of a latent, scaled: about that of numbers that are spread evenly over the range."""
_MOST_PARTS = 10
"""So many maps are adapted to parts of the throws at most, to predict the others."""
_STEPS = 30
_LOOKS = 4
"""What the nearest throws say is looked up in so many steps; later, others would be nearest again and again."""
_SMALL_STEP = 1e-5
"""After a step that is smaller [scaled, or m or rad], nothing would change that anybody could measure."""
_THROWS_FOR_BIAS = 3
_CLEARLY = 3.0
"""Misses that get smaller by so much are no accident: in squares, by those of so many standard deviations."""


class Method(str, Enum):
    """What a world is taken to differ by."""

    NONE = "none"
    """Nothing."""
    OFFSET = "offset"
    """All trials end elsewhere, by the same distance."""
    BIAS = "bias"
    """The robot does not do what it is told: parameters are shifted, and the end, too."""
    LATENT = "latent"
    """What the dataset varied from trial to trial: the latents have other values, and the end is shifted."""


ROLES = {Method.BIAS: Role.PARAMETER, Method.LATENT: Role.LATENT}
"""Which inputs differ, beside the place where trials end."""


@dataclass(frozen=True, eq=False)
class Adaptation:
    """What a few throws said of a world.

    Attributes:
        method: What the world is taken to differ by.
        correction: The difference.
        deviations: Standard deviations of the numbers that were found: of the biases or latents, scaled, then of the
            offset; shape ``(n_found,)``.
        before: Distance of each throw from where the map had it, shape ``(n_throws,)``.
        after: The same by a map that was adapted to other throws: up to ten throws, to all others, else to nine tenths
            of them; empty for a single throw.
    """

    method: Method
    correction: Correction
    deviations: Array
    before: Array
    after: Array


def adapt(
    learned: LearnedMap,
    parameters: Array,
    context: Array,
    places: Array,
    *,
    method: Method | None = None,
    scatter: float,
    latents_count: bool,
) -> Adaptation:
    """Find out how a world differs from the one of a map.

    The difference is the most probable one, by what is expected before any throw, and by the throws.

    Args:
        learned: The map, corrected or not: its latents are where the search begins.
        parameters: Scaled parameters of the throws, shape ``(n_throws, n_parameters)``.
        context: Scaled context of the throws, shape ``(n_throws, n_context)``.
        places: Where they ended, shape ``(n_throws, n_targets)``.
        method: What the world may differ by; None to choose by the number of throws, and by whether it helps.
        scatter: Standard deviation of each measured coordinate from its prediction [m or rad]: of repeated throws, and
            of the map.
        latents_count: Whether latents have an effect that is worth knowing.
    """
    throws = (parameters, context, places)
    before = _distances(learned, *throws)
    chosen = method or _choose(len(places), latents_count=latents_count)
    found, deviations = _find(learned, chosen, throws, scatter)
    after = np.empty(0)
    if len(places) > 1:
        after = _predict_by_others(learned, chosen, throws, scatter, found)
    helps = float((before**2).sum() - (after**2).sum()) > (_CLEARLY * scatter) ** 2
    if method is None and not helps:
        return Adaptation(Method.NONE, learned.correction, np.empty(0), before, before if len(after) else after)
    return Adaptation(chosen, _shift(learned.correction, chosen, found), deviations, before, after)


def adapt_by_nothing(learned: LearnedMap) -> Adaptation:
    """Leave a map as it is, as there are no throws."""
    return Adaptation(Method.NONE, learned.correction, np.empty(0), np.empty(0), np.empty(0))


def _choose(throws: int, *, latents_count: bool) -> Method:
    if latents_count:
        return Method.LATENT
    return Method.BIAS if throws >= _THROWS_FOR_BIAS else Method.OFFSET


def _predict_by_others(
    learned: LearnedMap, method: Method, throws: tuple[Array, Array, Array], scatter: float, begun: Array
) -> Array:
    """Distance of each throw from where a map has it that was adapted to others, shape ``(n_throws,)``.

    What all throws say is where the search begins: others say nearly the same.
    """
    parts = np.arange(len(throws[2])) % _MOST_PARTS
    distances = np.empty(len(parts))
    for part in range(min(len(parts), _MOST_PARTS)):
        held, others = parts == part, parts != part
        found, _ = _find(learned, method, (throws[0][others], throws[1][others], throws[2][others]), scatter, begun)
        world = learned.correct(_shift(learned.correction, method, found))
        distances[held] = _distances(world, throws[0][held], throws[1][held], throws[2][held])
    return distances


def _find(
    learned: LearnedMap, method: Method, throws: tuple[Array, Array, Array], scatter: float, begun: Array | None = None
) -> tuple[Array, Array]:
    """The most probable difference, as `_shift` takes it, and standard deviations of its numbers."""
    if method is Method.NONE:
        return np.empty(0), np.empty(0)
    parameters, context, places = throws
    targets = places.shape[1]
    role = ROLES.get(method)
    columns = learned.columns_of(role) if role else slice(0, 0)
    width = columns.stop - columns.start
    # How far each number is believed to go before any throw was seen: the prior of the least squares below.
    spread = np.full(width + targets, _SMALL_OFFSET if width else _OFFSET)
    spread[:width] = _BIAS if method is Method.BIAS else _LATENT
    low, high = _ends(learned, method, len(spread))
    found = np.zeros(len(spread)) if begun is None else begun
    for step in range(_STEPS):
        current = learned.correct(_shift(learned.correction, method, found))
        inputs = current.in_world(parameters, context)
        # Residuals by neighbours jump where the nearest ones change, so they are held after the first steps.
        if step < (_LOOKS if begun is None else 1):
            residuals = current.predict_residuals(inputs)
        missing = places - (current.forward.predict(inputs) + residuals + current.correction.offset)
        slopes = np.zeros((len(places), targets, len(found)))
        if width:
            slopes[:, :, :width] = current.forward.slopes(inputs, columns)
        slopes[:, :, width:] = np.eye(targets)
        flat = slopes.reshape(-1, len(found))
        transposed = np.ascontiguousarray(flat.T)
        # The normal equations of measurements and prior, with sums in the same order on every processor.
        normal = matmul(transposed, flat) / scatter**2 + np.eye(len(found)) / spread**2
        right = matmul(transposed, missing.reshape(-1, 1))[:, 0] / scatter**2 - found / spread**2
        before, found = found, _step_inside(normal, right, found, low, high)
        if np.abs(found - before).max() < _SMALL_STEP:
            break
    covariance = solve(normal, np.eye(len(found)))
    return found, np.sqrt(np.diagonal(covariance))


def _ends(learned: LearnedMap, method: Method, count: int) -> tuple[Array, Array]:
    """Between which numbers a difference lies: latents stay inside of what was collected."""
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    if method is Method.LATENT:
        latents = learned.correction.latents
        low[: len(latents)], high[: len(latents)] = -1.0 - latents, 1.0 - latents
    return low, high


def _step_inside(normal: Array, right: Array, found: Array, low: Array, high: Array) -> Array:
    """Go to where the normal equations lead; what would leave its range stays at its end, and the others know it."""
    held = np.full(len(found), np.nan)
    while True:
        free = np.isnan(held)
        reduced = np.where(free[:, np.newaxis] & free, normal, np.eye(len(found)))
        pull = right - matmul(normal, np.where(free, 0.0, held)[:, np.newaxis])[:, 0]
        wanted = found + np.where(free, solve(reduced, np.where(free, pull, 0.0)[:, np.newaxis])[:, 0], held)
        end = np.clip(wanted, low, high)
        leaving = free & (end != wanted)
        if not leaving.any():
            return end
        held[leaving] = (end - found)[leaving]


def _shift(begun: Correction, method: Method, found: Array) -> Correction:
    """A correction, with a difference added: biases or latents, then offsets; nothing for `Method.NONE`."""
    if method is Method.NONE:
        return begun
    width = len(found) - len(begun.offset)
    offset = begun.offset + found[width:]
    if method is Method.BIAS:
        return Correction(begun.bias + found[:width], begun.latents, offset)
    if method is Method.LATENT:
        return Correction(begun.bias, np.clip(begun.latents + found[:width], -1.0, 1.0), offset)
    return Correction(begun.bias, begun.latents, offset)


def _distances(learned: LearnedMap, parameters: Array, context: Array, places: Array) -> Array:
    distances: Array = np.sqrt(((learned.predict(parameters, context) - places) ** 2).sum(axis=1))
    return distances
