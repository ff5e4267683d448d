"""Aiming: from a target to the parameters of a trial that ends there."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from throwcollect.learning.learned_map import LearnedMap, Role
from throwcollect.reproducible_math import matmul, solve

Array = NDArray[np.float64]

REACH = 0.05
"""A target that no throw came as near to as this is out of reach, in the unit of the targets [m or rad]."""
TOLERANCE = 0.01
"""So is one that the best parameters are predicted to miss by more [m or rad]."""
_STARTS = 8
"""Number of throws, those that ended nearest to a target, from each of which a way to it is looked for."""
_MANY_STARTS = 48
"""The same where the ways are chosen among."""
_STEPS = 25
_SMALL_STEP = 1e-9
"""After a step that is smaller, scaled, nothing would change any more."""
_DAMPING = 1e-4
"""Error [m or rad], by scaled input, that a step may leave in order to be smaller."""
_CLOSE = 1e-4
"""Ways whose predicted misses [m or rad] are below this are equally good."""


class Choice(str, Enum):
    """Which parameters are taken where several lead to a target."""

    NEAREST = "nearest"
    """Those nearest to a throw of the dataset: the prediction is best there."""
    LEAST_EFFORT = "least-effort"
    """Those with the smallest predicted torque, as a share of its limit."""
    LEAST_SENSITIVE = "least-sensitive"
    """Those where errors of the parameters matter least."""


@dataclass(frozen=True, eq=False)
class Aims:
    """Parameters that lead to targets.

    Attributes:
        parameters: Scaled, shape ``(n, n_parameters)``.
        predicted: Where the trials should end, shape ``(n, n_targets)``.
        nearest: Distance of each target from the nearest throw, as it would have ended in this world, ``(n,)``.
        nearest_place: Where that throw would have ended, shape ``(n, n_targets)``.
        reachable: Whether a target can be reached, shape ``(n,)``.
    """

    parameters: Array
    predicted: Array
    nearest: Array
    nearest_place: Array
    reachable: NDArray[np.bool_]


def aim(learned: LearnedMap, targets: Array, context: Array, choice: Choice = Choice.NEAREST) -> Aims:
    """Find parameters for targets.

    From each of the throws that ended nearest to a target, Gauss-Newton steps lead to it: the shortest ones that the
    learned map allows, inside of the ranges of the dataset.

    Args:
        learned: The map of the world that is aimed in.
        targets: Shape ``(n, n_targets)``.
        context: Scaled, shape ``(n, n_context)``.
        choice: Which of several ways is taken.
    """
    rows = [_aim_at(learned, target, given, choice) for target, given in zip(targets, context, strict=True)]
    parameters, predicted, nearest = (np.array(column) for column in zip(*rows, strict=True))
    away = np.sqrt(((nearest - targets) ** 2).sum(axis=1))
    missed = np.sqrt(((predicted - targets) ** 2).sum(axis=1))
    return Aims(parameters, predicted, away, nearest, (away <= REACH) & (missed <= TOLERANCE))


def _aim_at(learned: LearnedMap, target: Array, context: Array, choice: Choice) -> tuple[Array, Array, Array]:
    """Parameters for one target, where they should lead, and where the nearest throw would have ended."""
    landings = learned.carry_over(context)
    squares = ((landings - target) ** 2).sum(axis=1)
    starts = np.argsort(squares, kind="stable")[: _STARTS if choice is Choice.NEAREST else _MANY_STARTS]
    begun = np.clip(learned.inputs[starts][:, learned.columns_of(Role.PARAMETER)], -1.0, 1.0)
    given = np.repeat(context[np.newaxis], len(starts), axis=0)
    shift = learned.residuals[starts] + learned.correction.offset
    parameters = _walk(learned, begun, given, target - shift)
    inputs = learned.in_world(parameters, given)
    predicted = learned.forward.predict(inputs) + shift
    missed = np.sqrt(((predicted - target) ** 2).sum(axis=1))
    worth = _judge(learned, choice, inputs, parameters - begun)
    best = int(np.lexsort((worth, np.maximum(missed, _CLOSE)))[0])
    return parameters[best], predicted[best], landings[starts[0]]


def _walk(learned: LearnedMap, parameters: Array, context: Array, goals: Array) -> Array:
    """Walk from parameters to where the polynomial has the goals, inside of the ranges."""
    columns = learned.columns_of(Role.PARAMETER)
    for _ in range(_STEPS):
        inputs = learned.in_world(parameters, context)
        missing = goals - learned.forward.predict(inputs)
        slopes = learned.forward.slopes(inputs, columns)
        step = _step(slopes, missing)
        # What would leave its range stays where it is, and the others make up for it.
        stuck = np.abs(np.clip(parameters + step, -1.0, 1.0) - parameters) < 1e-12
        step = _step(np.where(stuck[:, np.newaxis], 0.0, slopes), missing)
        before, parameters = parameters, np.clip(parameters + step, -1.0, 1.0)
        if np.abs(parameters - before).max() < _SMALL_STEP:
            break
    return parameters


def _step(slopes: Array, missing: Array) -> Array:
    """The shortest step that makes up for what is missing, shape ``(n, n_parameters)``."""
    transposed = np.swapaxes(slopes, 1, 2)
    squares = matmul(slopes, transposed) + _DAMPING**2 * np.eye(slopes.shape[1])
    return matmul(transposed, solve(squares, missing[..., np.newaxis]))[..., 0]


def _judge(learned: LearnedMap, choice: Choice, inputs: Array, steps: Array) -> Array:
    """How much speaks against each way."""
    if choice is Choice.LEAST_EFFORT:
        return learned.effort.predict(inputs)[:, 0]
    if choice is Choice.LEAST_SENSITIVE:
        slopes = learned.forward.slopes(inputs, learned.columns_of(Role.PARAMETER))
        steps = slopes.reshape(len(slopes), -1)
    squares: Array = (steps**2).sum(axis=1)
    return squares
