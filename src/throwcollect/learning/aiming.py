"""Aims: finds, for a target, the parameters of a trial that ends there, and explains why a target is out of reach."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.learning.learned_map import KeyRole, LearnedMap, find_nearest
from throwcollect.learning.polynomial import Array
from throwcollect.learning.score import format_length
from throwcollect.reproducible_math import matmul, solve

REACH = 0.05
"""A target is out of reach if all throws ended farther from it than this [m or rad], ..."""
TOLERANCE = 0.01
"""... or if the best parameters are predicted to miss it by more than this [m or rad]."""
_STARTS = 8
"""Number of throws, those that ended nearest to a target, from whose parameters the search begins."""
_MANY_STARTS = 48
"""The same number for the least effort, which needs more candidates to choose from."""
_TOGETHER = 32
"""Number of targets to aim at together: NumPy needs nearly the same time for short arrays, so one by one is slower."""
_CONTEXTS = 8
"""Number of contexts for which it is remembered where all throws of the dataset would have ended."""
_STEPS = 25
_SMALL_STEP = 1e-9
"""The search ends after a scaled step that is smaller than this."""
_DAMPING = 1e-4
"""Damping of the steps: the miss [m or rad] that is accepted to make a step shorter by one scaled unit."""
_CLOSE = 1e-4
"""Candidates whose predicted misses [m or rad] are below this count as equally good."""


class Choice(str, Enum):
    """Which parameters aiming takes if several lead to a target."""

    NEAREST = "nearest"
    """Those nearest to a throw of the dataset, where the prediction is best."""
    LEAST_EFFORT = "least-effort"
    """Those with the smallest predicted torque, as a share of its limit."""


@dataclass(frozen=True, eq=False)
class Aim:
    """How to reach a target.

    Attributes:
        target: Values of the model's targets, then of the keys that are given with them.
        parameters: Values by dotted key, as `Simulator.throw` takes them, also of the keys that are given.
        predicted: Where the trial should end, shape ``(n_targets,)``.
        reachable: Whether a throw of the dataset and the prediction are near enough to the target.
        nearest: Where the throw of the dataset that comes nearest to the target ends, shape ``(n_targets,)``: with what
            is given with the target, and in the world of an adapted model, as predicted.
    """

    target: Array
    parameters: dict[str, float]
    predicted: Array
    reachable: bool
    nearest: Array

    def as_dict(self) -> dict[str, Any]:
        """Return the same as a dictionary with lists in place of arrays, for JSON."""
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class Aims:
    """Parameters that lead to targets.

    Attributes:
        parameters: Scaled, shape ``(n, n_parameters)``.
        predicted: Where the trials should end, shape ``(n, n_targets)``.
        nearest_place: Where the throw nearest to each target would have ended in this world, shape ``(n, n_targets)``.
        reachable: Whether each target can be reached, shape ``(n,)``.
    """

    parameters: Array
    predicted: Array
    nearest_place: Array
    reachable: NDArray[np.bool_]


def aim(learned: LearnedMap, targets: Array, context: Array, choice: Choice = Choice.NEAREST) -> Aims:
    """Find parameters for targets.

    From the parameters of each throw that ended near a target, the shortest Gauss-Newton steps lead to the target,
    inside of the ranges of the dataset.

    Args:
        learned: The map of the world in which the throws will be.
        targets: Shape ``(n, n_targets)``.
        context: Scaled, shape ``(n, n_context)``.
        choice: Which of several candidates is taken.
    """
    if not len(targets):
        places = np.empty_like(targets)
        return Aims(np.empty((0, len(learned.axes_of(KeyRole.PARAMETER)))), places, places, np.empty(0, np.bool_))

    # Most often, all targets have the same context, and carrying over a large dataset takes longer than all else.
    @lru_cache(maxsize=_CONTEXTS)
    def carry_over(scaled: tuple[float, ...]) -> Array:
        return learned.carry_over(np.array(scaled, np.float64))

    found = []
    for first in range(0, len(targets), _TOGETHER):
        block = slice(first, first + _TOGETHER)
        landings = [carry_over(tuple(scaled)) for scaled in context[block].tolist()]
        found.append(_aim_at_once(learned, targets[block], context[block], landings, choice))
    parameters, predicted, nearest = (np.concatenate(column) for column in zip(*found, strict=True))
    away, missed = (np.linalg.norm(places - targets, axis=1) for places in (nearest, predicted))
    return Aims(parameters, predicted, nearest, (away <= REACH) & (missed <= TOLERANCE))


def _aim_at_once(
    learned: LearnedMap, targets: Array, context: Array, landings: Sequence[Array], choice: Choice
) -> tuple[Array, Array, Array]:
    """Find parameters for a few targets, with predicted places and with the places where the nearest throws ended.

    The landings are where all throws would have ended with the context of each target, shape ``(n_throws, n_targets)``.
    """
    numbers = np.arange(len(targets))
    count = _STARTS if choice is Choice.NEAREST else _MANY_STARTS
    pairs = zip(landings, targets, strict=True)
    starts = np.stack([find_nearest(((places - target) ** 2).sum(axis=1), count) for places, target in pairs])
    begun = np.clip(learned.inputs[starts][..., learned.columns_of(KeyRole.PARAMETER)], -1.0, 1.0)
    given = np.repeat(context[:, np.newaxis], starts.shape[1], axis=1)
    # While a candidate moves, it keeps the residual of the throw at which it begins, so only the polynomial has to be
    # inverted.
    shift = learned.residuals[starts] + learned.correction.offset
    parameters = _walk(learned, begun, given, targets[:, np.newaxis] - shift)
    inputs = learned.in_world(_list_rows(parameters), _list_rows(given))
    predicted = learned.forward.predict(inputs).reshape(shift.shape) + shift
    missed = np.linalg.norm(predicted - targets[:, np.newaxis], axis=2)
    costs = _weigh(learned, choice, inputs, _list_rows(parameters - begun)).reshape(starts.shape)
    # The last key is the first criterion: the miss, where all small misses count as equal; the cost is the second one.
    best = np.lexsort((costs, np.maximum(missed, _CLOSE)), axis=1)[:, 0]
    nearest = np.stack([places[first] for places, first in zip(landings, starts[:, 0], strict=True)])
    return parameters[numbers, best], predicted[numbers, best], nearest


def _list_rows(values: Array) -> Array:
    """Put the candidates of all targets into one list, shape ``(n · n_candidates, n_columns)``."""
    targets, candidates, columns = values.shape
    return values.reshape(targets * candidates, columns)


def _walk(learned: LearnedMap, parameters: Array, context: Array, goals: Array) -> Array:
    """Step from parameters to ones for which the polynomial predicts the goals, inside of the ranges.

    All arrays have the shape ``(n, n_candidates, n_columns)``. All candidates of a target stop at the same step, so
    their ends do not depend on other targets.
    """
    columns = learned.columns_of(KeyRole.PARAMETER)
    parameters = parameters.copy()
    walking = np.arange(len(parameters))
    for _ in range(_STEPS):
        before = _list_rows(parameters[walking])
        inputs = learned.in_world(before, _list_rows(context[walking]))
        missing = _list_rows(goals[walking]) - learned.forward.predict(inputs)
        slopes = learned.forward.slopes(inputs, columns)
        step = _step(slopes, missing)
        # A parameter that would leave its range stays where it is, and the other parameters make up for it.
        stuck = np.abs(np.clip(before + step, -1.0, 1.0) - before) < 1e-12
        step = _step(np.where(stuck[:, np.newaxis], 0.0, slopes), missing)
        after = np.clip(before + step, -1.0, 1.0)
        parameters[walking] = after.reshape(parameters[walking].shape)
        moved = np.abs(after - before).reshape(len(walking), -1).max(axis=1)
        walking = walking[moved >= _SMALL_STEP]
        if not len(walking):
            break
    return parameters


def _step(slopes: Array, missing: Array) -> Array:
    """The shortest step of the parameters that closes the distance to the goals, shape ``(n, n_parameters)``."""
    transposed = np.swapaxes(slopes, 1, 2)
    # The damped step of least norm: Jᵀ (J Jᵀ + λ² I)⁻¹ r, with J for the slopes and r for the missing distance.
    squares = matmul(slopes, transposed) + _DAMPING**2 * np.eye(slopes.shape[1])
    return matmul(transposed, solve(squares, missing[..., np.newaxis]))[..., 0]


def _weigh(learned: LearnedMap, choice: Choice, inputs: Array, steps: Array) -> Array:
    """Find the cost of each candidate by a choice, shape ``(n,)``."""
    if choice is Choice.LEAST_EFFORT:
        return learned.effort.predict(inputs)[:, 0]
    squares: Array = (steps**2).sum(axis=1)
    return squares


def explain_reach(learned: LearnedMap, aim: Aim) -> str:
    """Explain why a target is out of reach and, unless predictions mean nothing there, what comes nearest to it."""
    ends, given = np.split(aim.target, [len(learned.targets)])
    away, missed = (float(np.linalg.norm(place - ends)) for place in (aim.nearest, aim.predicted))
    outside = [
        f"{axis.key} was {axis.minimum:g} to {axis.maximum:g} in all throws"
        for axis, value in zip(learned.axes_of(KeyRole.CONTEXT), given.tolist(), strict=True)
        if not axis.minimum <= value <= axis.maximum
    ]
    if outside:
        # Far outside of what was collected, the polynomial gives any place at all.
        return f"{_join_numbers(aim.target)}; {'; '.join(outside)}"
    reasons = []
    if away > REACH:
        reasons.append(
            f"no throw came within {format_length(REACH, learned.targets)}, so predictions there are uncertain"
        )
    if missed > TOLERANCE:
        reasons.append(f"the best parameters are predicted to miss it by {format_length(missed, learned.targets)}")
    return (
        f"{_join_numbers(aim.target)}; {'; '.join(reasons)}\n"
        f"  the nearest throw ends at {_join_numbers(aim.nearest)} "
        f"({format_length(away, learned.targets)} away); predicted end: {_join_numbers(aim.predicted)}"
    )


def _join_numbers(values: Iterable[float]) -> str:
    return ",".join(f"{value:.3f}" for value in values)
