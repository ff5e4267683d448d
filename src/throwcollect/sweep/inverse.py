"""An inverse model of throws, which leads from a landing place to parameters and is learned during a collection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.reproducible_math import matmul, solve
from throwcollect.sweep.neighbours import Neighbours
from throwcollect.sweep.rows import Rows

_BASES = 8
"""Number of landed throws near a landing place at which steps towards this place begin."""
_NEIGHBOURS_PER_PARAMETER = 3
_RIDGE = 1e-3
"""Ridge of the linear models, as a share of the mean square spread of the neighbours along a parameter."""
_LEAST = 1e-300
"""Smallest ridge; with it, a model can be solved even if all its neighbours are the same point."""
_DAMPING_BINS = 0.1
"""Error in the target [bins] that a step may leave in order to be smaller."""
_LONGEST_STEP = 0.3
"""Longest step of the parameters, in widths of the unit cube."""
_ALONG_NOISE = 0.1
"""Standard deviation of the noise along directions in which, by the model, the ball lands at the same place."""
_NOISE = 0.02
"""Standard deviation of the noise in all directions."""
_FAILURE_NEIGHBOURS = 8
"""Number of ended throws near a proposal from which the probability that it lands is estimated."""
_PROGRESS = 0.7
"""A proposal is promising if its predicted distance from its goal is at most this share of the smallest one so far."""
_CLOSE_BINS = 0.5
"""A proposal within this distance of its goal is promising, too."""
_FAILURE_BINS = 2.0
"""A proposal that certainly fails counts as if it landed so many bins farther away from its goal."""


class InverseModel:
    """Proposes parameters by local linear models around throws that landed.

    Parameters are places in the unit cube, and targets are in bins.

    Args:
        parameters: Number of parameters.
        targets: Number of targets.
    """

    def __init__(self, parameters: int, targets: int) -> None:
        self._success = Rows(np.empty(0))
        self._all = Neighbours(parameters)
        self._landed = Neighbours(parameters)
        self._landings = Neighbours(targets)

    def learn(self, tried: NDArray[np.float64], landed: NDArray[np.bool_], places: NDArray[np.float64]) -> None:
        """Take in further throws, in order of trials.

        Args:
            tried: Parameters of the throws, shape ``(n_throws, n_parameters)``.
            landed: True for each throw that landed, shape ``(n_throws,)``.
            places: Landing places of the throws that landed, shape ``(n_landed, n_targets)``.
        """
        self._success.append(landed)
        self._all.append(tried)
        self._landed.append(tried[landed])
        self._landings.append(places)

    @property
    def usable(self) -> bool:
        """Whether enough throws have landed to make a model of so many parameters."""
        landed, parameters = self._landed.points.shape
        return bool(landed >= parameters + 2)

    def measure_distances(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the distance of places from the nearest landing [bins], shape ``(n_places,)``."""
        return self._landings.find(places, 1)[0][:, 0]

    def propose(
        self, goals: NDArray[np.float64], randomness: np.random.Generator
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Propose parameters, each of which should bring the ball to one of several goals.

        One step begins at each of the landed throws that are nearest to a goal: the shortest step that, by a linear
        model of the throw's neighbours, leads to the goal, plus noise, most of it along directions that do not change
        the landing, so that throws at one cell differ. The step with the smallest error is chosen: the predicted
        distance from the goal, plus a penalty for failed throws near its end.

        Args:
            goals: Landing places, shape ``(n_proposals, n_goals, n_targets)``.
            randomness: Source of the noise.

        Returns:
            Places in the unit cube, shape ``(n_proposals, n_parameters)``; and True for each promising one: the ball is
            predicted to land at its goal, or clearly nearer to it than any ball before.
        """
        flat = goals.reshape(-1, goals.shape[-1])
        # Several goals share bases, so the model around each base is made once.
        bases = self._landings.find(flat, _BASES)[1]
        distinct, which = np.unique(bases, return_inverse=True)
        # NumPy before version 2 returns a flat array.
        which = which.reshape(bases.shape)
        slopes, inverses = self._fit_linear_models(distinct)
        slope, inverse = slopes[which], inverses[which]
        start, landing, goal = self._landed.points[bases], self._landings.points[bases], flat[:, np.newaxis]
        step = _multiply(inverse, goal - landing)
        length = np.sqrt((step**2).sum(axis=-1, keepdims=True))
        # A linear model says little about places far from its neighbours.
        step *= _LONGEST_STEP / np.maximum(length, _LONGEST_STEP)
        along = _ALONG_NOISE * randomness.standard_normal(step.shape)
        # This takes away the part of the noise that, by the model, moves the landing.
        along -= _multiply(inverse, _multiply(slope, along))
        ends = start + step + along + _NOISE * randomness.standard_normal(step.shape)
        # `spread` takes places below 1.
        ends = np.clip(ends, 0.0, 1.0 - 1e-9)
        missing = landing + _multiply(slope, ends - start) - goal
        error = np.sqrt((missing**2).sum(axis=-1))
        near = self._all.find(ends.reshape(-1, ends.shape[-1]), _FAILURE_NEIGHBOURS)[1]
        failing = 1.0 - self._success.all[near].mean(axis=-1).reshape(error.shape)
        promising = error <= np.maximum(_CLOSE_BINS, _PROGRESS * self.measure_distances(flat)[:, np.newaxis])
        best = (error + _FAILURE_BINS * failing).reshape(len(goals), -1).argmin(axis=1)
        proposals = np.arange(len(goals))
        chosen: NDArray[np.float64] = ends.reshape(len(goals), -1, ends.shape[-1])[proposals, best]
        return chosen, promising.reshape(len(goals), -1)[proposals, best]

    def _fit_linear_models(self, bases: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Find the slopes of landings over parameters around throws that landed, and damped inverses of these slopes.

        Returns:
            Shapes ``(n_bases, n_targets, n_parameters)`` and ``(n_bases, n_parameters, n_targets)``.
        """
        parameters, landings = self._landed.points, self._landings.points
        dimensions = parameters.shape[1]
        count = _NEIGHBOURS_PER_PARAMETER * (dimensions + 1)
        neighbours = self._landed.find(parameters[bases], count)[1]
        moved = parameters[neighbours] - parameters[bases][:, np.newaxis]
        caused = landings[neighbours] - landings[bases][:, np.newaxis]
        transposed = np.swapaxes(moved, 1, 2)
        # This is ridge regression, solved by its normal equations: (M'M + r I) S' = M'C.
        spread = matmul(transposed, moved)
        ridge = _RIDGE * np.trace(spread, axis1=1, axis2=2) / dimensions + _LEAST
        ridged = spread + ridge[:, np.newaxis, np.newaxis] * np.eye(dimensions)
        slopes = np.swapaxes(solve(ridged, matmul(transposed, caused)), 1, 2)
        # The damped inverse is S'(SS' + d² I)⁻¹, the transpose of a solution, because the bracket is symmetric.
        damped = matmul(slopes, np.swapaxes(slopes, 1, 2)) + _DAMPING_BINS**2 * np.eye(slopes.shape[1])
        return slopes, np.swapaxes(solve(damped, slopes), 1, 2)


def _multiply(matrices: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return matmul(matrices, vectors[..., np.newaxis])[..., 0]
