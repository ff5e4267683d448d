"""Arithmetic with the same result, bit for bit, on every x86-64 processor.

NumPy chooses its code for exponentials, logarithms, powers and sines by the processor (with AVX-512 the last bits
differ), and so do BLAS and LAPACK for products and solutions of matrices. Code that determines bytes of a dataset calls
these functions instead, and of NumPy uses only operations that IEEE 754 defines: + - * /, square roots, comparisons.
The C library behind `math` has the same code for all processors with fused multiply-add (Intel since 2013, AMD since
2012).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce
from itertools import repeat
from operator import add

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _map_each(function: Callable[..., float], values: Array, *others: Iterable[float]) -> Array:
    each = map(function, values.ravel().tolist(), *others)
    return np.fromiter(each, np.float64, values.size).reshape(values.shape)


def exp(values: Array) -> Array:
    """Compute the exponential of each value."""
    return _map_each(math.exp, values)


def power(bases: Array, exponent: float) -> Array:
    """Raise each base to the power of one exponent."""
    return _map_each(math.pow, bases, repeat(exponent))


def sin(angles: Array) -> Array:
    """Compute the sine of each angle [rad]."""
    return _map_each(math.sin, angles)


def cos(angles: Array) -> Array:
    """Compute the cosine of each angle [rad]."""
    return _map_each(math.cos, angles)


def add_up(values: Iterable[float]) -> float:
    """Add from the first value to the last, and round each sum, unlike `sum` from Python 3.12 on."""
    return reduce(add, values, 0.0)


def matmul(left: Array, right: Array) -> Array:
    """Multiply matrices, and sum up each element in order; the leading axes are broadcast.

    Args:
        left: Shape ``(..., n, k)``.
        right: Shape ``(..., k, m)``, k at least 1.

    Returns:
        Shape ``(..., n, m)``.
    """
    # Each step adds one outer product to all elements, which fixes the order of additions within each element.
    product: Array = left[..., :, :1] * right[..., :1, :]
    for inner in range(1, left.shape[-1]):
        product += left[..., :, inner, np.newaxis] * right[..., np.newaxis, inner, :]
    return product


def solve(matrices: Array, right: Array) -> Array:
    """Find the solutions X of A X = B by elimination without exchange of rows.

    Args:
        matrices: A, symmetric and positive definite, shape ``(..., n, n)``.
        right: B, shape ``(..., n, m)``.

    Returns:
        Shape ``(..., n, m)``.
    """
    size = matrices.shape[-1]
    rows = np.concatenate([matrices, right], axis=-1)
    for pivot in range(size):
        chosen = rows[..., pivot : pivot + 1, :] / rows[..., pivot : pivot + 1, pivot : pivot + 1]
        # This turns the pivot's own row into zeros, too, and the next line puts it back.
        rows -= rows[..., :, pivot : pivot + 1] * chosen
        rows[..., pivot : pivot + 1, :] = chosen
    return rows[..., size:]
