"""Aiming: from a target to the parameters of a trial that ends there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from throwcollect.learning.arrays import Array
from throwcollect.learning.learned_map import LearnedMap, Role
from throwcollect.reproducible_math import matmul, solve

REACH = 0.05
"""A target is out of reach if all throws ended farther from it than this [m or rad], ..."""
TOLERANCE = 0.01
"""... or if the best parameters are predicted to miss it by more than this [m or rad]."""
_STARTS = 8
"""Number of throws, those that ended nearest to a target, from whose parameters the search begins."""
_MANY_STARTS = 48
"""The same number for choices other than the nearest: these need more candidates to choose from."""
_STEPS = 25
_SMALL_STEP = 1e-9
"""The search ends after a scaled step that is smaller."""
_DAMPING = 1e-4
"""Damping of the steps: how much miss [m or rad] a step may leave for each scaled unit that it is shorter by."""
_CLOSE = 1e-4
"""Candidates whose predicted misses [m or rad] are below this count as equally good."""


class Choice(str, Enum):
    """Which parameters aiming takes if several lead to a target."""

    NEAREST = "nearest"
    """Those nearest to a throw of the dataset, where the prediction is best."""
    LEAST_EFFORT = "least-effort"
    """Those with the smallest predicted torque, as a share of its limit."""
    LEAST_SENSITIVE = "least-sensitive"
    """Those at which errors of the parameters move the end of the trial least."""


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
        learned: The map of the world that is aimed in.
        targets: Shape ``(n, n_targets)``.
        context: Scaled, shape ``(n, n_context)``.
        choice: Which of several candidates is taken.
    """
    if not len(targets):
        places = np.empty_like(targets)
        return Aims(np.empty((0, len(learned.axes_of(Role.PARAMETER)))), places, places, np.empty(0, np.bool_))
    rows = [_aim_at(learned, target, given, choice) for target, given in zip(targets, context, strict=True)]
    parameters, predicted, nearest = (np.array(column) for column in zip(*rows, strict=True))
    away, missed = (np.linalg.norm(places - targets, axis=1) for places in (nearest, predicted))
    return Aims(parameters, predicted, nearest, (away <= REACH) & (missed <= TOLERANCE))


def _aim_at(learned: LearnedMap, target: Array, context: Array, choice: Choice) -> tuple[Array, Array, Array]:
    """Find parameters for one target; also their predicted place, and where the nearest throw would have ended."""
    landings = learned.carry_over(context)
    squares = ((landings - target) ** 2).sum(axis=1)
    starts = np.argsort(squares, kind="stable")[: _STARTS if choice is Choice.NEAREST else _MANY_STARTS]
    begun = np.clip(learned.inputs[starts][:, learned.columns_of(Role.PARAMETER)], -1.0, 1.0)
    given = np.tile(context, (len(starts), 1))
    # On its way, a candidate keeps the residual of the throw at which it begins, so only the polynomial has to be
    # inverted.
    shift = learned.residuals[starts] + learned.correction.offset
    parameters = _walk(learned, begun, given, target - shift)
    inputs = learned.in_world(parameters, given)
    predicted = learned.forward.predict(inputs) + shift
    missed = np.linalg.norm(predicted - target, axis=1)
    costs = _weigh(learned, choice, inputs, parameters - begun)
    # The last key counts first: the misses, of which all small ones are equal, and among equal ones the cost.
    best = int(np.lexsort((costs, np.maximum(missed, _CLOSE)))[0])
    return parameters[best], predicted[best], landings[starts[0]]


def _walk(learned: LearnedMap, parameters: Array, context: Array, goals: Array) -> Array:
    """Step from parameters to ones for which the polynomial predicts the goals, inside of the ranges."""
    columns = learned.columns_of(Role.PARAMETER)
    for _ in range(_STEPS):
        inputs = learned.in_world(parameters, context)
        missing = goals - learned.forward.predict(inputs)
        slopes = learned.forward.slopes(inputs, columns)
        step = _step(slopes, missing)
        # A parameter that would leave its range stays, and the others make up for it.
        stuck = np.abs(np.clip(parameters + step, -1.0, 1.0) - parameters) < 1e-12
        step = _step(np.where(stuck[:, np.newaxis], 0.0, slopes), missing)
        before, parameters = parameters, np.clip(parameters + step, -1.0, 1.0)
        if np.abs(parameters - before).max() < _SMALL_STEP:
            break
    return parameters


def _step(slopes: Array, missing: Array) -> Array:
    """The shortest step of the parameters that closes the distance to the goals, shape ``(n, n_parameters)``."""
    transposed = np.swapaxes(slopes, 1, 2)
    # The damped step of least norm: Jᵀ (J Jᵀ + λ² I)⁻¹ r, with J for the slopes and r for what is missing.
    squares = matmul(slopes, transposed) + _DAMPING**2 * np.eye(slopes.shape[1])
    return matmul(transposed, solve(squares, missing[..., np.newaxis]))[..., 0]


def _weigh(learned: LearnedMap, choice: Choice, inputs: Array, steps: Array) -> Array:
    """Find the cost of each candidate by a choice, shape ``(n,)``."""
    if choice is Choice.LEAST_EFFORT:
        return learned.effort.predict(inputs)[:, 0]
    if choice is Choice.LEAST_SENSITIVE:
        slopes = learned.forward.slopes(inputs, learned.columns_of(Role.PARAMETER))
        steps = slopes.reshape(len(slopes), -1)
    squares: Array = (steps**2).sum(axis=1)
    return squares
