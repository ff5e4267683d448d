"""Polynomials of several inputs, fitted to samples with the same result on every processor, and parts of JSON files."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, GetPydanticSchema
from pydantic_core import core_schema

from throwcollect.progress_log import ProgressLog
from throwcollect.reproducible_math import matmul, solve

Array = NDArray[np.float64]


class ModelEntry(BaseModel):
    """Base of all objects in these files: unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _read_lists(lists: Any, dtype: type[np.generic]) -> GetPydanticSchema:
    """Read lists of a JSON file as an array, and write the array as lists; arrays from Python code stay as they are."""
    return GetPydanticSchema(
        lambda _, handler: core_schema.json_or_python_schema(
            core_schema.no_info_after_validator_function(lambda rows: np.array(rows, dtype), handler(lists)),
            core_schema.is_instance_schema(np.ndarray),
            serialization=core_schema.plain_serializer_function_ser_schema(np.ndarray.tolist),
        )
    )


Vector = Annotated[Array, _read_lists(list[FiniteFloat], np.float64)]
Matrix = Annotated[Array, _read_lists(list[list[FiniteFloat]], np.float64)]
Exponents = Annotated[NDArray[np.int64], _read_lists(list[list[Annotated[int, Field(ge=0, le=10)]]], np.int64)]

DEGREES = (1, 2, 3, 4)
"""Degrees that are tried."""
SAMPLES_PER_TERM = 1.5
"""A degree is tried only if there are this many samples for each of its terms."""
_ALL_TERMS = 2
"""Up to this degree, minor inputs have all terms."""
_RIDGE = 1e-7
"""Ridge, as a share of the number of samples; it keeps terms small that the samples do not determine."""


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A polynomial of inputs that are scaled to [-1, 1].

    Attributes:
        exponents: Of each input in each term, shape ``(n_terms, n_inputs)``.
        coefficients: Of each term for each output, shape ``(n_terms, n_outputs)``.
    """

    exponents: Exponents
    coefficients: Matrix

    def predict(self, inputs: Array) -> Array:
        """Values of the outputs, shape ``(n, n_outputs)``, for inputs of shape ``(n, n_inputs)``."""
        return matmul(list_terms(inputs, self.exponents), self.coefficients)

    def slopes(self, inputs: Array, columns: slice) -> Array:
        """Derivatives of the outputs by some of the inputs, at least one.

        Args:
            inputs: Points at which to derive, shape ``(n, n_inputs)``.
            columns: Inputs to derive by.

        Returns:
            Shape ``(n, n_outputs, n_columns)``.
        """
        slopes = []
        for column in range(inputs.shape[1])[columns]:
            with_it = self.exponents[:, column] > 0
            # Indexing by a mask makes a copy, so the exponents of the polynomial are not changed below.
            lowered = self.exponents[with_it]
            factors = lowered[:, column : column + 1] * self.coefficients[with_it]
            lowered[:, column] -= 1
            zero = np.zeros((len(inputs), self.coefficients.shape[1]))
            # If no term has this input, the slope is zero.
            slopes.append(matmul(list_terms(inputs, lowered), factors) if len(lowered) else zero)
        return np.stack(slopes, axis=-1)


def fit_polynomial(inputs: Array, outputs: Array, degree: int, *, minor: int = 0) -> Polynomial:
    """Fit a polynomial by least squares.

    Args:
        inputs: Shape ``(n, n_inputs)``, in [-1, 1].
        outputs: Shape ``(n, n_outputs)``.
        degree: Highest sum of the exponents of a term.
        minor: Number of minor inputs, as `list_exponents` takes it.
    """
    exponents = list_exponents(inputs.shape[1], degree, minor=minor)
    return _solve(exponents, len(inputs), *_sum_up(list_terms(inputs, exponents), outputs))


def cross_validate(inputs: Array, outputs: Array, folds: NDArray[np.int64], *, minor: int = 0) -> dict[int, Array]:
    """Predict each sample by polynomials that were fitted to the other folds.

    Args:
        inputs: Shape ``(n, n_inputs)``, in [-1, 1].
        outputs: Shape ``(n, n_outputs)``.
        folds: Number of the fold of each sample, shape ``(n,)``.
        minor: Number of minor inputs, as `list_exponents` takes it.

    Returns:
        By degree: distance of each sample from its prediction, shape ``(n,)``.
    """
    errors: dict[int, Array] = {}
    numbers = np.unique(folds)
    # With many inputs and samples, this takes minutes.
    log = ProgressLog(len(DEGREES) * len(numbers), "polynomial", "fitted")
    for degree in DEGREES:
        exponents = list_exponents(inputs.shape[1], degree, minor=minor)
        if degree > 1 and len(exponents) * SAMPLES_PER_TERM > len(inputs):
            break
        sums = []
        for fold in numbers:
            held = folds == fold
            sums.append(_sum_up(list_terms(inputs[held], exponents), outputs[held]))
            log.note(len(errors) * len(numbers) + len(sums))
        squares, products = map(np.stack, zip(*sums, strict=True))
        distances = np.empty(len(inputs))
        for fold in numbers:
            held, others = folds == fold, numbers != fold
            # The sums over all others are those over their folds, added up.
            found = _solve(exponents, int((~held).sum()), squares[others].sum(axis=0), products[others].sum(axis=0))
            distances[held] = np.linalg.norm(found.predict(inputs[held]) - outputs[held], axis=1)
        errors[degree] = distances
    return errors


def list_exponents(inputs: int, degree: int, *, minor: int = 0) -> NDArray[np.int64]:
    """List the exponents of all terms up to a degree, shape ``(n_terms, inputs)``; the constant is the first.

    Args:
        inputs: Number of inputs.
        degree: Highest sum of the exponents of a term.
        minor: Number of minor inputs, which are the last ones, and mostly change the effect of other inputs. A term
            above the second degree has at most one of them, with exponent 1. With all terms, 15 inputs and the third
            degree would need more samples than datasets have.
    """
    rows = [
        [chosen.count(column) for column in range(inputs)]
        for total in range(degree + 1)
        for chosen in combinations_with_replacement(range(inputs), total)
        if total <= _ALL_TERMS or sum(column >= inputs - minor for column in chosen) <= 1
    ]
    return np.array(rows, np.int64)


def _sum_up(terms: Array, outputs: Array) -> tuple[Array, Array]:
    """The sums over samples that least squares needs: products of terms, and of terms with outputs."""
    transposed = np.ascontiguousarray(terms.T)
    return matmul(transposed, terms), matmul(transposed, outputs)


def _solve(exponents: NDArray[np.int64], samples: int, squares: Array, products: Array) -> Polynomial:
    return Polynomial(exponents, solve(squares + _RIDGE * samples * np.eye(len(exponents)), products))


def list_terms(inputs: Array, exponents: NDArray[np.int64]) -> Array:
    """Value of each term without its coefficient, shape ``(n, n_terms)``."""
    powers = [np.ones_like(inputs.T), np.ascontiguousarray(inputs.T)]
    for _ in range(1, int(exponents.max(initial=0))):
        powers.append(powers[-1] * powers[1])
    table = np.stack(powers)
    terms = np.ones((len(exponents), len(inputs)))
    for column in range(inputs.shape[1]):
        with_it = np.flatnonzero(exponents[:, column])
        terms[with_it] *= table[exponents[with_it, column], column]
    return terms.T
