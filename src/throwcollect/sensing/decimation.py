"""Makes meshes coarser: edges are collapsed where the surface changes least, many at once, in a fixed order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""Coordinates, one row for each axis, shape ``(3, n)``."""
Faces = NDArray[np.int64]
"""Numbers of the corners of triangles, counter-clockwise as seen from outside, shape ``(3, n)``."""

_BORDER = 10.0
"""Weight of the planes that hold the borders of a surface."""
_SHARE = 0.15
"""Share of edges that a round looks at: the cheapest."""
_ROUNDS = 80
_FLATTEST = 0.2
"""A triangle may turn so far, as a cosine, when an edge next to it collapses."""
_TINY_M = 0.004
"""A triangle with edges of less than this may turn over, as it is too small to be seen."""
_REGULARITY = 1e-3
"""Share of the squared length of an edge in its cost, so that flat regions keep triangles of one size."""


def cross(one: Points, other: Points) -> Points:
    """Multiply vectors, shape ``(3, n)``."""
    (a, b, c), (x, y, z) = one, other
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x])


def dot(one: Points, other: Points) -> NDArray[np.float64]:
    """Multiply vectors to numbers, shape ``(n,)``."""
    result: NDArray[np.float64] = one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
    return result


def weld(corners: Points, faces: Faces, cell_m: float) -> tuple[Points, Faces]:
    """Make one of the corners in each cell of a grid, and drop triangles without an area and repeated ones."""
    x, y, z = np.floor((corners - corners.min(axis=1, keepdims=True)) / cell_m + 0.5).astype(np.int64)
    _, first, number = np.unique(x + (y << 20) + (z << 40), return_index=True, return_inverse=True)
    return corners[:, first], _drop_useless(number.reshape(-1)[faces])


def _drop_useless(faces: Faces) -> Faces:
    one, two, three = faces
    faces = faces[:, (one != two) & (two != three) & (three != one)]
    # Each triangle begins with its lowest corner, so that equal ones are equal columns.
    begin, column = faces.argmin(axis=0), np.arange(faces.shape[1])
    one, two, three = (faces[(begin + shift) % 3, column] for shift in range(3))
    most = int(faces.max(initial=0)) + 1
    # Numbers of up to two million corners can be packed into 63 bits.
    key, first = np.unique((one * most + two) * most + three, return_index=True)
    one, two, three = one[first], two[first], three[first]
    # Two triangles back to back enclose nothing.
    alone = ~np.isin((one * most + three) * most + two, key, assume_unique=True)
    return np.stack([one, two, three])[:, alone]


def decimate(corners: Points, faces: Faces, most: int) -> tuple[Points, Faces]:
    """Collapse edges until there are at most so many triangles, or as few as the shape allows."""
    corners, quadrics, stubborn = corners.copy(), _find_quadrics(corners, faces), np.ones(corners.shape[1])
    for _ in range(_ROUNDS):
        before = faces.shape[1]
        if before <= most:
            break
        faces = _collapse_edges(corners, quadrics, stubborn, faces, (before - most + 1) // 2)
        if faces.shape[1] > 0.999 * before:
            break
    return corners, faces


def _find_quadrics(corners: Points, faces: Faces) -> NDArray[np.float64]:
    """Sum up, for each corner, the squared distances from the planes of its triangles as a form, shape ``(10, n)``.

    At an edge with one triangle, a plane at right angles to the triangle counts, too, so that the border stays.
    """
    a, b, c = (corners[:, each] for each in faces)
    wide = cross(b - a, c - a)
    forms = _add_planes(wide, a, np.sqrt(dot(wide, wide)), faces, corners.shape[1])
    start, end = faces.ravel(), faces[[1, 2, 0]].ravel()
    edges = np.minimum(start, end) * corners.shape[1] + np.maximum(start, end)
    _, first, count = np.unique(edges, return_index=True, return_counts=True)
    border = first[count == 1]
    one, other = corners[:, start[border]], corners[:, end[border]]
    along = other - one
    across = cross(along, wide[:, border % faces.shape[1]])
    ends = np.stack([start[border], end[border]])
    return forms + _add_planes(across, one, _BORDER * dot(along, along), ends, corners.shape[1])


def _add_planes(
    normal: Points, point: Points, weight: NDArray[np.float64], owners: Faces, size: int
) -> NDArray[np.float64]:
    """Add up the forms of planes for those corners that they belong to."""
    x, y, z = normal / np.maximum(np.sqrt(dot(normal, normal)), 1e-30)
    d = -dot(np.stack([x, y, z]), point)
    forms = (x * x, x * y, x * z, x * d, y * y, y * z, y * d, z * z, z * d, d * d)
    # `bincount` adds one number after the other.
    return np.stack([np.bincount(owners.ravel(), np.tile(form * weight, len(owners)), size) for form in forms])


def _find_best(form: NDArray[np.float64], middle: Points) -> Points:
    """Find the points with the least values of forms; where these hardly change, points near to the middle."""
    xx, xy, xz, xd, yy, yz, yd, zz, zd, _ = form
    firm = 1e-3 * (xx + yy + zz) + 1e-30
    xx, yy, zz = xx + firm, yy + firm, zz + firm
    x, y, z = (firm * each - other for each, other in zip(middle, (xd, yd, zd), strict=True))
    # Cramer's rule.
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    scale = xx * a + xy * b + xz * c
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    best: Points = np.stack([a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z]) / scale
    return best


def _measure(form: NDArray[np.float64], at: Points) -> NDArray[np.float64]:
    """Compute the values of forms at points."""
    x, y, z = at
    xx, xy, xz, xd, yy, yz, yd, zz, zd, dd = form
    value: NDArray[np.float64] = x * (xx * x + 2 * (xy * y + xz * z + xd))
    value += y * (yy * y + 2 * (yz * z + yd))
    value += z * (zz * z + 2 * zd) + dd
    return value


def _collapse_edges(
    corners: Points, quadrics: NDArray[np.float64], stubborn: NDArray[np.float64], faces: Faces, wanted: int
) -> Faces:
    """Collapse the cheapest edges that have no corner in common, and change the arrays of corners in place.

    An edge whose corners have been `stubborn` before costs more, so that others get their turn.
    """
    size = corners.shape[1]
    start, end = faces.ravel(), faces[[1, 2, 0]].ravel()
    low, high = np.divmod(np.unique(np.minimum(start, end) * size + np.maximum(start, end)), size)
    one, other, form = corners[:, low], corners[:, high], quadrics[:, low] + quadrics[:, high]
    edge = other - one
    middle = (one + other) / 2
    places = np.stack([_find_best(form, middle), one, other])
    costs = np.stack([_measure(form, place) for place in places])
    best = costs.argmin(axis=0)
    length = dot(edge, edge)
    cost = np.take_along_axis(costs, best[np.newaxis], axis=0)[0] + _REGULARITY * length * length
    cost = (np.maximum(cost, 0) + 1e-18) * stubborn[low] * stubborn[high]
    order = np.argsort(cost, kind="stable")[: max(wanted, int(_SHARE * len(cost)))]
    rank = np.arange(len(order))
    lowest = np.full(size, len(cost))
    np.minimum.at(lowest, low[order], rank)
    np.minimum.at(lowest, high[order], rank)
    chosen = order[(lowest[low[order]] == rank) & (lowest[high[order]] == rank)][:wanted]
    # What would turn a triangle over is left as it is.
    goes = np.arange(size)
    moved = corners.copy()
    goes[high[chosen]] = low[chosen]
    moved[:, low[chosen]] = places[best[chosen], :, chosen].T
    a, b, c = (corners[:, each] for each in faces)
    p, q, r = (moved[:, goes[each]] for each in faces)
    before, after = cross(b - a, c - a), cross(q - p, r - p)
    cosine = dot(before, after)
    turns = (cosine < _FLATTEST * np.sqrt(dot(before, before) * dot(after, after))) & (dot(after, after) > _TINY_M**4)
    spoiled = np.zeros(size, bool)
    spoiled[goes[faces[:, turns]]] = True
    stubborn[:] = np.where(spoiled, np.minimum(stubborn * 4, 256), np.maximum(stubborn / 2, 1))
    chosen = chosen[~spoiled[low[chosen]]]
    keep, drop = low[chosen], high[chosen]
    goes = np.arange(size)
    goes[drop] = keep
    corners[:, keep] = places[best[chosen], :, chosen].T
    quadrics[:, keep] += quadrics[:, drop]
    return _drop_useless(goes[faces])
