"""Adapts a learned map to another world by a few throws in that world."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import numpy as np
from pydantic import FiniteFloat

from throwcollect.dataset.misses import find_median
from throwcollect.errors import ConfigError
from throwcollect.learning.learned_map import Correction, KeyRole, LearnedMap
from throwcollect.learning.polynomial import Array, ModelEntry
from throwcollect.reproducible_math import matmul, solve

_OFFSET = 0.1
"""Standard deviation that is expected of the offset [m or rad] before any throw."""
_SMALL_OFFSET = 0.02
"""The same for methods whose biases or latents explain most of the difference."""
_BIAS = 0.2
"""Standard deviation that is expected of a bias, scaled: a tenth of the parameter's range."""
_LATENT = 0.6
"""Standard deviation that is expected of a latent, scaled: about that of numbers that are even over the range."""
_MOST_PARTS = 10
"""The throws are divided into at most this many parts, to predict each part by a map that is adapted to the others."""
_STEPS = 30
_LOOKS = 4
"""In this many first steps, residuals are those of the nearest throws; later, these throws might alternate for ever."""
_SMALL_STEP = 1e-5
"""The search ends after a step smaller than this [scaled, or m or rad]: no measurement could show the difference."""
_THROWS_FOR_BIAS = 3
_FAR = 2.0
"""Parameters and context farther than this from the middle of their range [scaled: the range ends at 1] are refused."""
_LEAST_WIDTH = 1.0
"""A region where throws ended counts as at least this wide [m or rad], as another world may shift a small region by
more than its width."""
_CLEARLY = 3.0
"""Adapting helps if the sum of squared misses falls by more than the square of this many standard deviations."""


class Method(str, Enum):
    """How a world is assumed to differ from the world of the map."""

    NONE = "none"
    """It does not differ."""
    OFFSET = "offset"
    """All trials end elsewhere, by the same offset."""
    BIAS = "bias"
    """The robot does not do what is commanded: all parameters have a bias, and ends an offset."""
    LATENT = "latent"
    """The latents, which the dataset varied from trial to trial, have other values, and ends an offset."""


ROLES = {Method.BIAS: KeyRole.PARAMETER, Method.LATENT: KeyRole.LATENT}
"""Inputs that differ, apart from the offset."""


class AdaptedNumber(ModelEntry):
    """A number that adaptation found.

    Attributes:
        name: A latent, which has `value` in this world; or a parameter or a target, to which `value` is added.
        value: In the unit of the name.
        deviation: Standard deviation of `value`.
    """

    name: str
    value: FiniteFloat
    deviation: FiniteFloat


class Adaptation(ModelEntry):
    """How a world differs, found by a few throws in it.

    Attributes:
        method: How the world is assumed to differ.
        throws: Number of throws.
        scatter: Standard deviation that was assumed for each measured coordinate, in the unit of the targets.
        before: Distances of the throws from where the model predicted them before it was adapted.
        after: The same distances, each from the prediction of a model that was adapted to the other throws; empty for a
            single throw.
        found: The numbers that were found.
    """

    method: Method
    throws: int
    scatter: FiniteFloat
    before: list[FiniteFloat]
    after: list[FiniteFloat]
    found: list[AdaptedNumber]

    @property
    def medians(self) -> tuple[float | None, float | None]:
        """Medians of `before` and of `after`; None if there are no distances."""
        return find_median(self.before), find_median(self.after)


def adapt(
    learned: LearnedMap,
    parameters: Array,
    context: Array,
    places: Array,
    *,
    method: Method | None = None,
    scatter: float,
) -> tuple[Correction, Adaptation]:
    """Find out how a world differs from the world of a map.

    The result is the correction of the map for the most probable difference, given the throws and what was expected
    before them, and how it was found.

    Args:
        learned: The map, corrected or not; the search begins with its latents.
        parameters: Scaled parameters of the throws, shape ``(n_throws, n_parameters)``.
        context: Scaled context of the throws, shape ``(n_throws, n_context)``.
        places: Where they ended, shape ``(n_throws, n_targets)``; without throws, no difference is found.
        method: How the world may differ; None to choose by the number of throws, and by whether the method helps.
        scatter: Standard deviation of each measured coordinate of repeated throws [m or rad].
    """
    throws = (parameters, context, places)
    # A measured place differs from its prediction by the scatter of the throw, and by the error of the map.
    scatter = float(np.hypot(scatter, learned.error))
    before = _measure_distances(learned, *throws)
    after = before if len(places) > 1 else np.empty(0)
    correction, numbers = learned.correction, list[AdaptedNumber]()
    chosen = method or (Method.BIAS if len(places) >= _THROWS_FOR_BIAS else Method.OFFSET)
    if method is None and learned.latents_count:
        chosen = Method.LATENT
    if not len(places):
        chosen = Method.NONE
    if chosen is not Method.NONE:
        found, deviations = _find(learned, chosen, throws, scatter)
        others = _predict_by_others(learned, chosen, throws, scatter, found) if len(places) > 1 else np.empty(0)
        helps = float((before**2).sum() - (others**2).sum()) > (_CLEARLY * scatter) ** 2
        if method is None and not helps:
            chosen = Method.NONE
        else:
            correction, after = _shift(learned.correction, chosen, found), others
            numbers = _list_found(learned, correction, chosen, deviations)
    return correction, Adaptation(
        method=chosen,
        throws=len(places),
        scatter=scatter,
        before=before.tolist(),
        after=after.tolist(),
        found=numbers,
    )


def _list_found(learned: LearnedMap, correction: Correction, method: Method, deviations: Array) -> list[AdaptedNumber]:
    """List the numbers that were found, in their units; deviations are those of `_find`."""
    role = ROLES.get(method)
    axes = learned.axes_of(role) if role else ()
    found = []
    for number, axis in enumerate(axes):
        half = (axis.maximum - axis.minimum) / 2
        if role is KeyRole.LATENT:
            value = axis.minimum + (float(correction.latents[number]) + 1) * half
        else:
            value = float(correction.bias[number]) * half
        found.append(AdaptedNumber(name=axis.key, value=value, deviation=float(deviations[number]) * half))
    offsets = zip(learned.targets, correction.offset.tolist(), deviations[len(axes) :].tolist(), strict=True)
    return [*found, *(AdaptedNumber(name=name, value=value, deviation=spread) for name, value, spread in offsets)]


def refuse_far_throws(learned: LearnedMap, parameters: Array, context: Array, places: Array) -> None:
    """Refuse throws where the map predicts nothing: mostly mistakes, such as degrees in place of radians.

    Args:
        learned: The map.
        parameters: Scaled parameters of the throws, shape ``(n_throws, n_parameters)``.
        context: Scaled context of the throws, shape ``(n_throws, n_context)``.
        places: Where they ended, shape ``(n_throws, n_targets)``.
    """
    for role, inputs in ((KeyRole.PARAMETER, parameters), (KeyRole.CONTEXT, context)):
        for number, column in np.argwhere(np.abs(inputs) > _FAR).tolist():
            axis = learned.axes_of(role)[column]
            raise ConfigError(
                f"throw {number}: {axis.key} is {learned.unscale(role, inputs)[number, column]:g}",
                expected=f"about {axis.minimum:g} to {axis.maximum:g}, the range that the model was learned from",
            )
    low, high = learned.outputs.min(axis=0), learned.outputs.max(axis=0)
    away = np.linalg.norm(np.maximum(0.0, np.maximum(low - places, places - high)), axis=1)
    ranges = ", ".join(f"{least:.3g} to {most:.3g}" for least, most in zip(low.tolist(), high.tolist(), strict=True))
    for number in np.flatnonzero(away > max(_LEAST_WIDTH, float(np.linalg.norm(high - low)))).tolist():
        ends = zip(learned.targets, places[number].tolist(), strict=True)
        raise ConfigError(
            f"throw {number}: {', '.join(f'{target} is {end:g}' for target, end in ends)}",
            expected=f"about {ranges}, where the throws ended that the model was learned from",
            hint="check units, which the names end with, and the order of the numbers",
        )


def _predict_by_others(
    learned: LearnedMap, method: Method, throws: tuple[Array, Array, Array], scatter: float, begun: Array
) -> Array:
    """Measure the distance of each throw from the prediction of a map that was adapted to others, ``(n_throws,)``.

    The search begins with `begun`, the difference found by all throws, because most of the throws lead nearly to that.
    """
    parts = np.arange(len(throws[2])) % _MOST_PARTS
    distances = np.empty(len(parts))
    for part in range(min(len(parts), _MOST_PARTS)):
        held, others = parts == part, parts != part
        found, _ = _find(learned, method, (throws[0][others], throws[1][others], throws[2][others]), scatter, begun)
        world = learned.correct(_shift(learned.correction, method, found))
        distances[held] = _measure_distances(world, throws[0][held], throws[1][held], throws[2][held])
    return distances


def _find(
    learned: LearnedMap, method: Method, throws: tuple[Array, Array, Array], scatter: float, begun: Array | None = None
) -> tuple[Array, Array]:
    """Find the most probable difference, as `_shift` takes it, and standard deviations of its numbers."""
    parameters, context, places = throws
    targets = places.shape[1]
    role = ROLES.get(method)
    columns = learned.columns_of(role) if role else slice(0, 0)
    width = columns.stop - columns.start
    # The standard deviation that is expected of each number before any throw: the prior of the least squares below.
    spread = np.full(width + targets, _SMALL_OFFSET if width else _OFFSET)
    spread[:width] = _BIAS if method is Method.BIAS else _LATENT
    low, high = np.full(len(spread), -np.inf), np.full(len(spread), np.inf)
    if method is Method.LATENT:
        # Latents stay inside of the ranges of the dataset.
        low[:width], high[:width] = -1.0 - learned.correction.latents, 1.0 - learned.correction.latents
    found = np.zeros(len(spread)) if begun is None else begun
    for step in range(_STEPS):
        current = learned.correct(_shift(learned.correction, method, found))
        inputs = current.in_world(parameters, context)
        # Residuals jump where other throws become the nearest ones, so they stay the same after the first steps.
        if step < (_LOOKS if begun is None else 1):
            residuals = current.predict_residuals(inputs)
        missing = places - (current.forward.predict(inputs) + residuals + current.correction.offset)
        slopes = np.zeros((len(places), targets, len(found)))
        if width:
            slopes[:, :, :width] = current.forward.slopes(inputs, columns)
        # The slope of an offset is 1 for its own target, and 0 for the others.
        slopes[:, :, width:] = np.eye(targets)
        flat = slopes.reshape(-1, len(found))
        transposed = np.ascontiguousarray(flat.T)
        # The normal equations of measurements and prior, with sums in the same order on every processor.
        normal = matmul(transposed, flat) / scatter**2 + np.eye(len(found)) / spread**2
        right = matmul(transposed, missing.reshape(-1, 1))[:, 0] / scatter**2 - found / spread**2
        before, found = found, _step_inside(normal, right, found, low, high)
        if np.abs(found - before).max() < _SMALL_STEP:
            break
    # The normal matrix includes the prior, so its inverse is the covariance of the most probable difference.
    covariance = solve(normal, np.eye(len(found)))
    return found, np.sqrt(np.diagonal(covariance))


def _step_inside(normal: Array, right: Array, found: Array, low: Array, high: Array) -> Array:
    """Solve the normal equations; a number that would leave its bounds is held at its bound, and the others adjust."""
    held = np.full(len(found), np.nan)
    while True:
        free = np.isnan(held)
        reduced = np.where(free[:, np.newaxis] & free, normal, np.eye(len(found)))
        pull = right - matmul(normal, np.where(free, 0.0, held)[:, np.newaxis])[:, 0]
        unbounded = found + np.where(free, solve(reduced, np.where(free, pull, 0.0)[:, np.newaxis])[:, 0], held)
        if not np.isfinite(unbounded).all():
            raise ConfigError(
                "the throws ended too far from where the model has them",
                expected="places in the unit of the targets",
                hint="the method offset accepts any place",
            )
        bounded = np.clip(unbounded, low, high)
        leaving = free & (bounded != unbounded)
        if not leaving.any():
            return bounded
        held[leaving] = (bounded - found)[leaving]


def _shift(begun: Correction, method: Method, found: Array) -> Correction:
    """Add a difference to a correction: biases or latents, then offsets."""
    width = len(found) - len(begun.offset)
    shifted = replace(begun, offset=begun.offset + found[width:])
    if method is Method.BIAS:
        return replace(shifted, bias=begun.bias + found[:width])
    if method is Method.LATENT:
        return replace(shifted, latents=np.clip(begun.latents + found[:width], -1.0, 1.0))
    return shifted


def _measure_distances(learned: LearnedMap, parameters: Array, context: Array, places: Array) -> Array:
    distances: Array = np.linalg.norm(learned.predict_ends(parameters, context) - places, axis=1)
    return distances
