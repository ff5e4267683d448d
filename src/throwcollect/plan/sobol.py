"""Draws scrambled Sobol sequences: points that fill the unit cube more evenly than random points.

`scipy.stats.qmc.Sobol` draws the same points, bit for bit; a test compares them. With this code, plans do not depend on
the version of SciPy, whose statistics take longer to import than everything else that a command needs.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

MOST_DIMENSIONS = 1024
"""Size of the table of direction numbers."""
BITS = 30
"""Bits of a coordinate; a sequence has ``2**BITS`` points."""

_TABLE = Path(__file__).with_name("joe_kuo_d6.txt")


def draw_sobol(count: int, dimensions: int, randomness: np.random.Generator) -> NDArray[np.float64]:
    """Draw the first points of a sequence that is scrambled by a random matrix and a random shift (Matousek 1998).

    Args:
        count: Number of points, from 1 to ``2**BITS``.
        dimensions: Number of coordinates, from 1 to `MOST_DIMENSIONS`.
        randomness: Source of the scrambling.

    Returns:
        Coordinates from 0 to 1, 1 excluded, shape ``(count, dimensions)``.
    """
    places = np.arange(BITS, dtype=np.uint32)
    shift = _pack(randomness.integers(2, size=(dimensions, BITS), dtype=np.uint32), places)
    # A triangular matrix with ones on its diagonal can be inverted, so scrambled points stay evenly spread.
    below = np.tril(randomness.integers(2, size=(dimensions, BITS, BITS), dtype=np.uint32), -1)
    matrices = _pack(below + np.eye(BITS, dtype=np.uint32), places[::-1])
    numbers = _multiply(matrices, _compute_direction_numbers(dimensions))
    # In Gray code, two neighbours differ in one bit: the lowest bit that is set in the index of the second neighbour.
    index = np.arange(1, count)
    flipped = np.frexp(index & -index)[1] - 1
    points = np.empty((count, dimensions))
    column = np.empty(count, dtype=np.uint32)
    for i in range(dimensions):
        column[0] = shift[i]
        column[1:] = numbers[i][flipped]
        points[:, i] = np.bitwise_xor.accumulate(column) * 2.0**-BITS
    return points


def _pack(bits: NDArray[np.uint32], places: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Pack the bits of the last axis into numbers, each at its place."""
    packed: NDArray[np.uint32] = (bits << places).sum(axis=-1, dtype=np.uint32)
    return packed


def _multiply(matrices: NDArray[np.uint32], numbers: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Multiply matrices of bits by numbers, which are columns of bits with the highest first; rows are packed alike.

    Args:
        matrices: Shape ``(dimensions, BITS)``.
        numbers: Shape ``(dimensions, count)``.
    """
    common = matrices[:, None, :] & numbers[:, :, None]
    # This folds each number onto its lowest bit, which becomes the parity of all bits: the sum of products modulo 2.
    for half in (16, 8, 4, 2, 1):
        common ^= common >> np.uint32(half)
    return _pack(common & np.uint32(1), np.arange(BITS, dtype=np.uint32)[::-1])


def _compute_direction_numbers(dimensions: int) -> NDArray[np.uint32]:
    """Compute direction numbers, shape ``(dimensions, BITS)``, by the recurrence of Bratley and Fox (1988)."""
    # The first coordinate has no polynomial in the table: its numbers before the shift are all 1 (van der Corput).
    numbers = np.ones((dimensions, BITS), dtype=np.int64)
    with open(_TABLE, encoding="ascii") as lines:
        entries = (line.split() for line in lines if not line.startswith("#"))
        for row, (_, degree, coefficients, *first) in zip(numbers[1:], islice(entries, dimensions - 1), strict=True):
            s, a = int(degree), int(coefficients)
            row[:s] = [int(word) for word in first]
            for j in range(s, BITS):
                number = row[j - s] ^ (row[j - s] << s)
                for k in range(1, s):
                    if a >> (s - 1 - k) & 1:
                        number ^= row[j - k] << k
                row[j] = number
    return (numbers << np.arange(BITS)[::-1]).astype(np.uint32)
