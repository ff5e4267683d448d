"""Postures that are known to be clear of collisions; they show that all postures near them are clear, too."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from throwcollect.pinocchio_library import pinocchio

_DOUBT_M = 1e-4
"""How much a computed distance may exceed the true one; the solver's own tolerance is a hundredth of that."""
_MOST_TRIES = 300
"""Most postures that are examined: with more postures, the search for a near one would take longer than it saves."""
_LEAST_WORTH = 3
"""A posture is kept if it shows that at least this many postures of the motion are clear, itself included."""
_UNBOUNDED_M = 1e9
"""Reach of links beyond a joint of another kind, because it is unknown how they move."""
_TURNS, _SLIDES = "JointModelR", "JointModelP"


class ClearPostures:
    """Postures in which pairs of links are farther apart than a margin, and how far around each of them this holds.

    A joint that turns by an angle moves the points of the links beyond it by at most the angle times a reach, which is
    the same in all postures. So two links at a distance d stay apart by at least d minus the sum of angles times
    reaches over the joints between the two. Angles of postures are in the order of the model.

    Args:
        model: The robot with all joints.
        geometry: Its shapes, and the pairs of them that must stay apart.
        reaches: The result of `find_reaches`.
        pairs: Numbers of the pairs that this object looks at, shape ``(n,)`` with at least one.
        margin_m: A pair is clear if its distance is larger than this [m].
    """

    def __init__(
        self,
        model: pinocchio.Model,
        geometry: pinocchio.GeometryModel,
        reaches: NDArray[np.float64],
        pairs: NDArray[np.intp],
        *,
        margin_m: float,
    ) -> None:
        self._model, self._geometry = model, geometry
        self._data, self._placed = model.createData(), geometry.createData()
        self._needed = margin_m + _DOUBT_M
        self._pairs, self._reaches = pairs, reaches[pairs]
        self._tries = _MOST_TRIES
        self._postures = np.empty((0, model.nq))
        self._steepness = np.empty((0, model.nq))

    def find_unknown(self, postures: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Find the postures [rad], shape ``(n, n_joints)``, that are not known to be clear, shape ``(n,)``."""
        lowest, highest = postures.min(axis=0), postures.max(axis=0)
        # A known posture that is too far from the box around `postures` cannot show that any of them is clear.
        gaps = np.maximum(np.maximum(lowest - self._postures, self._postures - highest), 0.0)
        near = np.flatnonzero((gaps * self._steepness).sum(axis=1) < 1)
        known, steepness = self._postures[near], self._steepness[near]
        # A known posture is clear by some slack, and the way to another posture uses up a share of it. Joints that have
        # the same angle in all postures use up nothing.
        spent = np.zeros((len(postures), len(near)))
        for joint in np.flatnonzero((known != lowest).any(axis=0) | (lowest != highest)):
            spent += np.abs(postures[:, joint, np.newaxis] - known[:, joint]) * steepness[:, joint]
        return np.asarray((spent >= 1).all(axis=1))

    def look_at_first(self, postures: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Compute whether the first posture is clear, and find the postures that are not known to be clear then.

        Shapes are those of `find_unknown`.
        """
        unknown: NDArray[np.bool_] = np.ones(len(postures), bool)
        if not self._tries:
            return unknown
        self._tries -= 1
        slack = self._compute_distances(postures[0]) - self._needed
        if slack.min() <= 0:
            return unknown
        # For each joint, the steepest pair counts, so that the bound holds for all pairs at once.
        steepness = (self._reaches / slack[:, np.newaxis]).max(axis=0)
        unknown = np.greater_equal(np.abs(postures - postures[0]) @ steepness, 1)
        if np.count_nonzero(~unknown) >= _LEAST_WORTH:
            self._postures = np.vstack([self._postures, postures[0]])
            self._steepness = np.vstack([self._steepness, steepness])
        return unknown

    def _compute_distances(self, posture: NDArray[np.float64]) -> NDArray[np.float64]:
        pinocchio.computeDistances(self._model, self._data, self._geometry, self._placed, posture)
        distances = np.array([result.min_distance for result in self._placed.distanceResults], np.float64)
        return distances[self._pairs]


def find_reaches(model: pinocchio.Model, geometry: pinocchio.GeometryModel) -> NDArray[np.float64]:
    """Find how far a turn of each joint moves the links of each pair against each other at most [m/rad].

    Returns:
        Shape ``(n_pairs, n_joints)``, in the order of the model; 0 for joints that are not between the two links.
    """
    shapes = np.array([_find_reach(model, shape) for shape in geometry.geometryObjects])
    pairs = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    # Without the reshape, a robot without shapes, and so without pairs, would have no columns.
    one, other = np.array(pairs, np.intp).reshape(-1, 2).T
    # A joint that carries both links, or neither, does not move them against each other.
    between = (shapes[one] > 0) != (shapes[other] > 0)
    reaches: NDArray[np.float64] = between * (shapes[one] + shapes[other])
    return reaches


def _find_reach(model: pinocchio.Model, shape: pinocchio.GeometryObject) -> NDArray[np.float64]:
    """Find the largest distance of a shape, in any posture, from each joint that carries it [m]; 0 for other joints."""
    shape.geometry.computeLocalAABB()
    box = shape.geometry.aabb_local
    corners = [shape.placement.act(np.array(corner)) for corner in product(*zip(box.min_, box.max_, strict=True))]
    reaches = np.zeros(model.nq)
    joint, reach = shape.parentJoint, max(float(np.linalg.norm(corner)) for corner in corners)
    while joint > 0:
        column, kind = model.idx_qs[joint], model.joints[joint].shortname()
        # In Pinocchio, the names of all joints that turn about an axis begin so, such as JointModelRX, and those of
        # joints that slide so: these move all points by as much as they move, whatever turns before them.
        if kind.startswith(_SLIDES):
            reaches[column] = 1.0
            reach += float(max(abs(model.lowerPositionLimit[column]), abs(model.upperPositionLimit[column])))
        else:
            reach = reach if kind.startswith(_TURNS) else _UNBOUNDED_M
            reaches[column] = reach
        # Whatever the angles are, a point is no farther away than the sum of the lengths of the links up to it.
        reach += float(np.linalg.norm(model.jointPlacements[joint].translation))
        joint = model.parents[joint]
    return reaches
