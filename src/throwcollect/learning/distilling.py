"""Distils aiming, from a target to parameters, into one polynomial, also as a graph of ONNX for controllers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError
from throwcollect.extras import lazily
from throwcollect.learning.learned_map import KeyRole, LearnedMap
from throwcollect.learning.polynomial import (
    SAMPLES_PER_TERM,
    Array,
    Polynomial,
    Vector,
    fit_polynomial,
    list_exponents,
    list_terms,
)
from throwcollect.reproducible_math import matmul, solve

ONNX = "model.onnx"
_OPERATORS, _FORMAT = 13, 8
"""Versions of the operators and of the file, which are old enough for the runtimes of controllers."""

helper, numpy_helper = lazily("onnx.helper"), lazily("onnx.numpy_helper")


_DEGREE = 4
"""Degree of the polynomial, if there are enough throws; higher degrees hit no better."""
_MOST_THROWS = 1000
"""The places where the first throws ended, at most this many, are the targets to learn from."""
_STEPS = 10
_TO_THE_MIDDLE = 0.005
"""Miss [m or rad] that costs as much as one parameter at an end of its range: of the many parameters that lead to a
target, those in the middle of their ranges are preferred."""
_SMALL = 1e-12
"""Ridge that keeps coefficients small where the targets do not determine them."""


@dataclass(frozen=True, eq=False)
class DistilledMap:
    """A polynomial from targets to parameters.

    Attributes:
        low: Smallest values of the targets that it was learned from, in their units, shape ``(n_targets,)``.
        high: Largest values, shape ``(n_targets,)``.
        polynomial: Scaled targets (-1 is the smallest value, 1 the largest) and scaled context to scaled parameters.
    """

    low: Vector
    high: Vector
    polynomial: Polynomial

    def aim(self, targets: Array, context: Array) -> Array:
        """Scaled parameters for targets, clipped to their ranges, shape ``(n, n_parameters)``.

        Args:
            targets: Shape ``(n, n_targets)``.
            context: Scaled, shape ``(n, n_context)``.
        """
        return np.clip(self.polynomial.predict(_scale_inputs(targets, context, self.low, self.high)), -1.0, 1.0)


def distil(learned: LearnedMap) -> DistilledMap:
    """Find the polynomial whose parameters lead to their targets, as the map predicts it.

    The polynomial is not fitted to the parameters of the throws: different parameters may lead to the same target, but
    their mean would lead elsewhere. Instead, Gauss-Newton steps for all coefficients together reduce the misses that
    the map predicts.
    """
    for name, ends in zip(learned.targets, learned.outputs.T, strict=True):
        if ends.min() == ends.max():
            raise ConfigError(f"{name} has the value {ends[0]:g} in all throws", expected="targets that vary")
    parameters, context = (
        learned.inputs[:_MOST_THROWS, learned.columns_of(role)] for role in (KeyRole.PARAMETER, KeyRole.CONTEXT)
    )
    targets = learned.predict_ends(parameters, context)
    low, high = targets.min(axis=0), targets.max(axis=0)
    inputs = _scale_inputs(targets, context, low, high)
    exponents = list_exponents(inputs.shape[1], 1)
    for degree in range(2, _DEGREE + 1):
        if len(more := list_exponents(inputs.shape[1], degree)) * SAMPLES_PER_TERM <= len(inputs):
            exponents = more
    terms = np.ascontiguousarray(list_terms(inputs, exponents))
    linear = fit_polynomial(inputs, parameters, 1).coefficients
    coefficients = np.zeros((len(exponents), parameters.shape[1]))
    # The terms of the first degree come first in every list of exponents.
    coefficients[: len(linear)] = linear
    squares = matmul(np.ascontiguousarray(terms.T), terms)
    best, least = coefficients, np.inf
    for _ in range(_STEPS):
        raw = matmul(terms, coefficients)
        missing = targets - learned.predict_ends(np.clip(raw, -1.0, 1.0), context)
        cost = float((missing**2).sum() + _TO_THE_MIDDLE**2 * (raw**2).sum())
        if cost < least:
            best, least = coefficients, cost
        coefficients = coefficients + _step(learned, terms, squares, raw, context, missing)
    return DistilledMap(low, high, Polynomial(exponents, best))


def _step(learned: LearnedMap, terms: Array, squares: Array, raw: Array, context: Array, missing: Array) -> Array:
    """The Gauss-Newton step of the coefficients, shape ``(n_terms, n_parameters)``."""
    clipped = np.clip(raw, -1.0, 1.0)
    slopes = learned.forward.slopes(learned.in_world(clipped, context), learned.columns_of(KeyRole.PARAMETER))
    # A parameter beyond its range is clipped, so small changes of coefficients do not change it.
    slopes = slopes * (clipped == raw)[:, np.newaxis]
    wide = (slopes[:, :, np.newaxis, :] * terms[:, np.newaxis, :, np.newaxis]).reshape(missing.size, -1)
    transposed = np.ascontiguousarray(wide.T)
    size = raw.shape[1]
    # The unknowns are ordered by term and then by parameter, as the columns of `wide` are.
    middle = _TO_THE_MIDDLE**2 * np.kron(squares, np.eye(size)) + _SMALL * np.eye(len(transposed))
    pull = _TO_THE_MIDDLE**2 * matmul(np.ascontiguousarray(terms.T), raw).reshape(-1, 1)
    right = matmul(transposed, missing.reshape(-1, 1)) - pull
    return solve(matmul(transposed, wide) + middle, right).reshape(-1, size)


def _scale_inputs(targets: Array, context: Array, low: Array, high: Array) -> Array:
    return np.hstack([(targets - low) / (high - low) * 2.0 - 1.0, context])


def encode_onnx(learned: LearnedMap, distilled: DistilledMap) -> bytes:
    """Encode a distilled map as a graph of 32-bit floats; the map that it was distilled from has the ranges.

    Its input ``target`` has the shape ``(n, n_targets + n_context)``, its output ``parameters``
    ``(n, n_parameters)``, both in the order and the units that ``model.json`` has.
    Parameters stay inside of their ranges.
    """
    chosen, given = learned.axes_of(KeyRole.PARAMETER), learned.axes_of(KeyRole.CONTEXT)
    low = np.array([*distilled.low.tolist(), *(axis.minimum for axis in given)])
    high = np.array([*distilled.high.tolist(), *(axis.maximum for axis in given)])
    least, most = (np.array([getattr(axis, end) for axis in chosen]) for end in ("minimum", "maximum"))
    polynomial = distilled.polynomial
    constants = {
        "scale": 2.0 / (high - low),
        "middle": (high + low) / 2.0,
        "exponents": polynomial.exponents,
        "coefficients": polynomial.coefficients,
        "minus_one": np.array(-1.0),
        "one": np.array(1.0),
        "half_range": (most - least) / 2.0,
        "amid": (most + least) / 2.0,
    }
    nodes = [
        helper.make_node("Sub", ["target", "middle"], ["moved"]),
        helper.make_node("Mul", ["moved", "scale"], ["scaled"]),
        helper.make_node("Unsqueeze", ["scaled", "axis"], ["rows"]),
        helper.make_node("Pow", ["rows", "exponents"], ["powers"]),
        # In this version of the operators, the axes of ReduceProd are an attribute, and those of Unsqueeze an input.
        helper.make_node("ReduceProd", ["powers"], ["terms"], axes=[2], keepdims=0),
        helper.make_node("MatMul", ["terms", "coefficients"], ["raw"]),
        helper.make_node("Clip", ["raw", "minus_one", "one"], ["inside"]),
        helper.make_node("Mul", ["inside", "half_range"], ["stretched"]),
        helper.make_node("Add", ["stretched", "amid"], ["parameters"]),
    ]
    float32 = 1  # TensorProto.FLOAT
    numbers = [numpy_helper.from_array(values.astype(np.float32), name) for name, values in constants.items()]
    axis: NDArray[np.int64] = np.array([1], np.int64)
    graph = helper.make_graph(
        nodes,
        "from a target to parameters",
        [helper.make_tensor_value_info("target", float32, ["n", len(low)])],
        [helper.make_tensor_value_info("parameters", float32, ["n", len(chosen)])],
        [*numbers, numpy_helper.from_array(axis, "axis")],
    )
    operators = [helper.make_opsetid("", _OPERATORS)]
    model = helper.make_model(graph, producer_name="throwcollect", opset_imports=operators, ir_version=_FORMAT)
    encoded: bytes = model.SerializeToString(deterministic=True)
    return encoded
