"""Finds which triangle is nearest in each pixel: rows of triangles first, then the pixels of each row.

A pixel belongs to a triangle if its centre does. Triangles with a common edge compute it from the same numbers in the
same order, so that they leave no gap and have no pixel in common.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

NONE = -1
"""Number of the triangle in a pixel without one."""


class Outlines(NamedTuple):
    """Triangles in a picture, in pixels from its upper left corner.

    Attributes:
        x: To the right, for each corner, shape ``(3, n)``.
        y: Downwards, shape ``(3, n)``.
        owner: Number of the triangle that is drawn, shape ``(n,)``; two outlines may be parts of the same one.
    """

    x: Numbers
    y: Numbers
    owner: Integers


def spread(counts: Integers) -> tuple[Integers, Integers]:
    """Number the cells of rows with so many cells: the row of each, and its place in the row."""
    row = np.repeat(np.arange(len(counts)), counts)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)


def find_nearest(outlines: Outlines, nearness: Sequence[Numbers], width: int, height: int) -> Integers:
    """Find the number of the nearest triangle in each pixel.

    Args:
        outlines: The triangles.
        nearness: For each drawn triangle, what a number that is larger when it is nearer grows by with each pixel to
            the right and downwards, and its value in the upper left corner; it is above 0 in the triangle.
        width: Pixels in a row.
        height: Number of rows.

    Returns:
        Number of the drawn triangle, or `NONE`, shape ``(height * width,)``.
    """
    (x0, x1, x2), (y0, y1, y2) = outlines.x, outlines.y
    low, high = np.minimum(np.minimum(y0, y1), y2), np.maximum(np.maximum(y0, y1), y2)
    first = np.clip(np.ceil(low - 0.5), 0, height)
    rows = np.maximum(np.clip(np.ceil(high - 0.5), 0, height) - first, 0)
    left, right = np.minimum(np.minimum(x0, x1), x2), np.maximum(np.maximum(x0, x1), x2)
    # Most triangles of a small picture lie between the centres of pixels.
    columns = np.clip(np.ceil(right - 0.5), 0, width) - np.clip(np.ceil(left - 0.5), 0, width)
    some = np.flatnonzero((rows > 0) & (columns > 0))
    corners = _sort_down(*(each[some] for each in (x0, y0, x1, y1, x2, y2)))
    (xa, ya), (xb, yb), (xc, yc) = corners
    with np.errstate(divide="ignore", invalid="ignore"):
        long, upper, lower = (xc - xa) / (yc - ya), (xb - xa) / (yb - ya), (xc - xb) / (yc - yb)
    row, step = spread(rows[some].astype(np.int64))
    line = first[some].astype(np.int64)[row] + step
    y = line + 0.5
    along = y - ya[row]
    one = xa[row] + along * long[row]
    is_upper = y < yb[row]
    begin_x, begin_y = np.where(is_upper, xa[row], xb[row]), np.where(is_upper, ya[row], yb[row])
    two = begin_x + (y - begin_y) * np.where(is_upper, upper[row], lower[row])
    begin = np.clip(np.ceil(np.minimum(one, two) - 0.5), 0, width)
    length = np.maximum(np.clip(np.ceil(np.maximum(one, two) - 0.5), 0, width) - begin, 0).astype(np.int64)
    owner = outlines.owner[some][row]
    # What is the same for all pixels of a row is computed once.
    right_by, down_by, corner = (each[owner] for each in nearness)
    base, start = corner + down_by * y, begin.astype(np.int64)
    pixel_row, place = spread(length)
    column = start[pixel_row] + place
    value = base[pixel_row] + right_by[pixel_row] * (column + 0.5)
    return choose_nearest(line[pixel_row] * width + column, value, owner[pixel_row], width * height)


def _sort_down(
    x0: Numbers, y0: Numbers, x1: Numbers, y1: Numbers, x2: Numbers, y2: Numbers
) -> tuple[tuple[Numbers, Numbers], ...]:
    """Sort the corners of each triangle from the uppermost to the lowest."""
    corners = [(x0, y0), (x1, y1), (x2, y2)]
    for one, other in ((0, 1), (1, 2), (0, 1)):
        (xa, ya), (xb, yb) = corners[one], corners[other]
        swaps = yb < ya
        corners[one] = np.where(swaps, xb, xa), np.where(swaps, yb, ya)
        corners[other] = np.where(swaps, xa, xb), np.where(swaps, ya, yb)
    return tuple(corners)


def choose_nearest(cell: Integers, value: Numbers, owner: Integers, count: int) -> Integers:
    """Choose, for each cell, the owner of the largest value; of equal ones, the one with the larger number."""
    # The bits of a positive number, read as an integer, grow with it. So one maximum chooses value and owner.
    key = np.maximum(value, 0).astype(np.float32).view(np.uint32).astype(np.int64) << 32
    best = np.full(count, -1, np.int64)
    np.maximum.at(best, cell, key | owner)
    return np.where(best < 0, NONE, best & 0xFFFFFFFF)


def clip_near(corners: NDArray[np.float64], owner: Integers, near: float) -> tuple[NDArray[np.float64], Integers]:
    """Cut off what is nearer than a plane.

    Args:
        corners: Of each triangle, in front of the sensor along the last axis, shape ``(3, 3, n)``: corner, axis.
        owner: Number of each triangle.
        near: Distance of the plane.

    Returns:
        Corners of what is left of the triangles, and its owners: up to two triangles of each.
    """
    inside = corners[:, 2] > near
    count = inside.sum(axis=0)
    kept, owners = [corners[:, :, count == 3]], [owner[count == 3]]
    for many in (1, 2):
        cut = np.flatnonzero(count == many)
        # The corner that is alone on its side comes first.
        alone = (inside[:, cut] if many == 1 else ~inside[:, cut]).argmax(axis=0)
        a, b, c = (corners[(alone + shift) % 3, :, cut].T for shift in range(3))
        ab, ac = (_cut(a, each, near) if many == 1 else _cut(each, a, near) for each in (b, c))
        made = [(a, ab, ac)] if many == 1 else [(ab, b, c), (ab, c, ac)]
        kept += [np.stack(each) for each in made]
        owners += [owner[cut]] * len(made)
    return np.concatenate(kept, axis=2), np.concatenate(owners)


def _cut(inside: NDArray[np.float64], outside: NDArray[np.float64], near: float) -> NDArray[np.float64]:
    share = (inside[2] - near) / (inside[2] - outside[2])
    point = inside + (outside - inside) * share
    point[2] = near
    result: NDArray[np.float64] = point
    return result
