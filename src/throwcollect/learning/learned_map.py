"""The learned map: where a trial with given parameters ends, in a world that may differ from that of the dataset."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat

from throwcollect.learning.polynomial import (
    Array,
    Matrix,
    ModelEntry,
    Polynomial,
    Vector,
    cross_validate,
    fit_polynomial,
)
from throwcollect.units import unit_of_name

EFFORT = "effort_peak_share"
"""Column of the largest share of a joint's torque limit."""
_NEIGHBOURS = 8
"""Number of nearest throws whose residuals correct the polynomial at a point."""
_THROWS_PER_PARAMETER = 3
_EFFORT_DEGREE = 2
_FOLDS = 5
_CELL = 0.05
"""Width of the cells of targets [m or rad]."""
_WORTH_KNOWING = 2.0
"""Latents are worth knowing if predictions without them are at least this many times worse."""

_Map = TypeVar("_Map", bound="LearnedMap")


class KeyRole(str, Enum):
    """How aiming treats a swept key."""

    PARAMETER = "parameter"
    """Aiming chooses its value; a number of the task."""
    CONTEXT = "context"
    """Its value is given together with the target, such as the height of the plane to land on."""
    LATENT = "latent"
    """It belongs to the world; its value is only known from throws in that world."""


@dataclass(frozen=True)
class Axis:
    """A swept key, and the range that the dataset covers.

    Attributes:
        key: Dotted key.
        role: How aiming treats it.
        minimum: Smallest value in the dataset, in the key's unit.
        maximum: Largest value.
        nominal: Value in the configuration, which is assumed for the world until adapting finds another one.
    """

    key: str
    role: KeyRole
    minimum: FiniteFloat
    maximum: FiniteFloat
    nominal: FiniteFloat

    @property
    def unit(self) -> str:
        """Unit of the values; empty for a pure number."""
        return "rad" if self.key.endswith("_joint") else unit_of_name(self.key)


@dataclass(frozen=True, eq=False)
class Correction:
    """How a world differs from the world of the dataset. Without a difference, all numbers but the latents are 0.

    Attributes:
        bias: Added to parameters of this world to get those of the dataset's world, scaled, shape ``(n_parameters,)``.
        latents: Values of the latents in this world, scaled, ``(n_latents,)``.
        offset: Added to the place where a trial ends, in the units of the targets, shape ``(n_targets,)``.
    """

    bias: Vector
    latents: Vector
    offset: Vector


class LearnedMap(ModelEntry):
    """Maps parameters to where a trial ends: by a polynomial, corrected by the residuals of the nearest throws.

    Inputs are scaled: -1 is the minimum of an axis, 1 its maximum. A file of JSON has no throws.

    Attributes:
        axes: The inputs: parameters, then context, then latents.
        targets: Columns of the table of throws that say where a trial ended.
        forward: The polynomial: all inputs to targets.
        effort: The polynomial of the largest share of a joint's torque limit.
        errors: By degree: median distance of throws from their prediction by polynomials fitted to others.
        blind_error: The smallest such distance when latents are no inputs; None if there are no latents.
        correction: How the world differs from the dataset's.
        values: Inputs of the throws that it was learned from, in the units of their keys, shape ``(n, n_axes)``.
        outputs: Places where those throws ended, shape ``(n, n_targets)``.
        efforts: Their largest shares of a joint's torque limit, shape ``(n,)``.
    """

    axes: tuple[Axis, ...] = Field(min_length=1)
    targets: tuple[str, ...] = Field(min_length=1)
    forward: Polynomial
    effort: Polynomial
    errors: dict[int, FiniteFloat] = Field(min_length=1)
    blind_error: FiniteFloat | None
    correction: Correction
    values: Matrix = Field(default=np.empty((0, 0)), exclude=True)
    outputs: Matrix = Field(default=np.empty((0, 0)), exclude=True)
    efforts: Vector = Field(default=np.empty(0), exclude=True)

    @property
    def error(self) -> float:
        """The smallest of the errors, which belongs to the chosen degree."""
        return min(self.errors.values())

    @property
    def latents_count(self) -> bool:
        """Whether latents have an effect that is worth knowing."""
        return self.blind_error is not None and self.blind_error >= _WORTH_KNOWING * self.error

    @cached_property
    def inputs(self) -> Array:
        """`values`, scaled."""
        return scale_values(self.axes, self.values)

    @cached_property
    def residuals(self) -> Array:
        """Outputs minus the polynomial's predictions, ``(n, n_targets)``."""
        return self.outputs - self.forward.predict(self.inputs)

    def axes_of(self, role: KeyRole) -> tuple[Axis, ...]:
        """The axes of a role."""
        return tuple(axis for axis in self.axes if axis.role is role)

    def columns_of(self, role: KeyRole) -> slice:
        """The columns of inputs that belong to a role; an empty slice if none does."""
        columns = [number for number, axis in enumerate(self.axes) if axis.role is role]
        return slice(columns[0], columns[-1] + 1) if columns else slice(0, 0)

    def scale(self, role: KeyRole, values: Array) -> Array:
        """Scale values of the axes of a role, shape ``(n, n_axes of the role)``."""
        return scale_values(self.axes_of(role), values)

    def unscale(self, role: KeyRole, inputs: Array) -> Array:
        """Values of scaled inputs of a role, in the units of their keys."""
        low, high = _list_bounds(self.axes_of(role))
        return low + (inputs + 1.0) / 2.0 * (high - low)

    def in_world(self, parameters: Array, context: Array) -> Array:
        """Inputs for which the polynomial predicts trials of the corrected world.

        Args:
            parameters: Scaled, shape ``(n, n_parameters)``.
            context: Scaled, shape ``(n, n_context)``.

        Returns:
            Shape ``(n, n_axes)``.
        """
        latents = np.tile(self.correction.latents, (len(parameters), 1))
        return np.hstack([parameters + self.correction.bias, context, latents])

    def predict_ends(self, parameters: Array, context: Array) -> Array:
        """Where trials end in the corrected world, in the units of the targets, shape ``(n, n_targets)``.

        Parameters and context are those of `in_world`.
        """
        inputs = self.in_world(parameters, context)
        return self.forward.predict(inputs) + self.predict_residuals(inputs) + self.correction.offset

    def carry_over(self, context: Array) -> Array:
        """Where the throws of the dataset would have ended in the corrected world, shape ``(n, n_targets)``.

        The context is scaled and the same for all throws, shape ``(n_context,)``.
        """
        parameters = self.inputs[:, self.columns_of(KeyRole.PARAMETER)]
        moved = self.in_world(parameters, np.tile(context, (len(parameters), 1)))
        # Each throw keeps its own residual, as only the world around it changes.
        return self.residuals + self.forward.predict(moved) + self.correction.offset

    def correct(self: _Map, correction: Correction | None) -> _Map:
        """The map of another world, or with None of the dataset's own world, learned from the same throws."""
        # A copy has the cached values, too, which follow from the throws alone.
        return self.model_copy(update={"correction": correction or _no_correction(self.axes, self.targets)})

    def begin_from(self: _Map, values: Array, outputs: Array, efforts: Array) -> _Map:
        """The same map with other throws, from which aiming begins; the arguments are its attributes."""
        other = self.model_copy(update={"values": values, "outputs": outputs, "efforts": efforts})
        for cached in ("inputs", "residuals"):
            vars(other).pop(cached, None)
        return other

    def predict_residuals(self, inputs: Array) -> Array:
        """Means of the residuals of the throws nearest to scaled inputs, weighted by closeness.

        The inputs have the shape ``(n, n_axes)``, the means ``(n, n_targets)``.
        """
        predicted = np.empty((len(inputs), len(self.targets)))
        for row, place in enumerate(inputs):
            squares = ((self.inputs - place) ** 2).sum(axis=1)
            near = find_nearest(squares, _NEIGHBOURS)
            # The small number keeps the weight finite if the point is the same as that of a throw.
            weights = 1.0 / (squares[near] + 1e-12)
            predicted[row] = (weights[:, np.newaxis] * self.residuals[near]).sum(axis=0) / weights.sum()
        return predicted


def find_nearest(squares: Vector, count: int) -> NDArray[np.intp]:
    """Find the throws with the smallest squares of distances, shape ``(n_throws,)``, the nearest first."""
    # Sorting all throws would take longer, so this first finds those that are at least as near as the last of the
    # nearest ones.
    last = min(count, len(squares)) - 1
    few = np.flatnonzero(squares <= np.partition(squares, last)[last])
    # Throws at the same distance are taken in the order of trials, on every machine.
    return few[np.argsort(squares[few], kind="stable")][:count]


def _no_correction(axes: tuple[Axis, ...], targets: tuple[str, ...]) -> Correction:
    """Make the correction of the dataset's own world, whose latents are those of its configuration."""
    latents = tuple(axis for axis in axes if axis.role is KeyRole.LATENT)
    nominal = np.array([axis.nominal for axis in latents], np.float64)
    scaled = np.clip(scale_values(latents, nominal), -1.0, 1.0)
    parameters = sum(axis.role is KeyRole.PARAMETER for axis in axes)
    return Correction(np.zeros(parameters), scaled, np.zeros(len(targets)))


def scale_values(axes: tuple[Axis, ...], values: Array) -> Array:
    """Scale values of axes, shape ``(..., n_axes)``: -1 is the minimum of an axis, 1 its maximum."""
    low, high = _list_bounds(axes)
    return (values - low) / (high - low) * 2.0 - 1.0


def _list_bounds(axes: tuple[Axis, ...]) -> tuple[Array, Array]:
    return np.array([axis.minimum for axis in axes], np.float64), np.array([axis.maximum for axis in axes], np.float64)


def fit_throws(
    axes: tuple[Axis, ...], targets: tuple[str, ...], values: Array, outputs: Array, efforts: Array
) -> LearnedMap:
    """Learn from throws that succeeded; the arguments are attributes of the map.

    The degree of the polynomial is the one that predicts best: throws of one cell stay together, and each fifth of the
    cells is predicted from the others.
    """
    inputs, folds = scale_values(axes, values), _assign_folds(outputs)
    # Latents come last. Products of two latents have little effect, so such terms are left out.
    minor = sum(axis.role is KeyRole.LATENT for axis in axes)
    errors = _find_medians(cross_validate(inputs, outputs, folds, minor=minor))
    known = [axis.role is not KeyRole.LATENT for axis in axes]
    # The error of predictions without latents shows whether latents are worth knowing.
    blind = None if all(known) else min(_find_medians(cross_validate(inputs[:, known], outputs, folds)).values())
    degree = min(errors, key=errors.__getitem__)
    return LearnedMap(
        axes=axes,
        targets=targets,
        forward=fit_polynomial(inputs, outputs, degree, minor=minor),
        effort=fit_polynomial(inputs, efforts[:, np.newaxis], min(_EFFORT_DEGREE, degree)),
        errors=errors,
        blind_error=blind,
        correction=_no_correction(axes, targets),
        values=values,
        outputs=outputs,
        efforts=efforts,
    )


def _find_medians(errors: dict[int, Array]) -> dict[int, float]:
    return {degree: float(np.median(each)) for degree, each in errors.items()}


def count_needed_throws(parameters: int) -> int:
    """Smallest number of throws from which a model with this many parameters can be learned."""
    return _THROWS_PER_PARAMETER * (parameters + 1)


def number_cells(places: Array) -> NDArray[np.int64]:
    """Numbers of the cell of 5 cm or 0.05 rad that each place lies in, shape ``(n, n_targets)`` as the places."""
    return np.floor(places / _CELL).astype(np.int64)


def _assign_folds(outputs: Array) -> NDArray[np.int64]:
    """Number of the fold of each throw; throws that ended in one cell are in one fold."""
    # A hash of the cell gives the fold, so that a throw stays in its fold when the dataset grows.
    numbers = [hashlib.sha256(cell.tobytes()).digest()[0] % _FOLDS for cell in number_cells(outputs)]
    if len(set(numbers)) < 2:
        # All throws ended in cells of one fold, so nothing would be left to learn from; now their order gives the fold.
        numbers = [number % _FOLDS for number in range(len(numbers))]
    return np.array(numbers, np.int64)
