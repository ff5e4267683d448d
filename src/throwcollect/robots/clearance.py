"""How close the links of Talos and the spoon come to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

from throwcollect.config.schema import ToolConfig
from throwcollect.errors import ConfigError
from throwcollect.robots.model import share_directory, urdf_path
from throwcollect.robots.spoon import boxes

MARGIN_M = 0.002
"""Least distance between links. It covers how far the spoon, 1 m from the torso's axis, cuts into a body of the head's
curvature on a path between two postures 0.02 rad apart."""

GRIPPER = "gripper_right_base_link"
"""Link that the spoon is fixed to."""

SPOON = "spoon"
"""Name of the spoon where links are named."""

_HANDS = ("gripper_left_", "gripper_right_")
_HOLDING = ("gripper_right_", "wrist_right_", "arm_right_5_", "arm_right_6_", "arm_right_7_")


@dataclass(frozen=True)
class Approach:
    """Two links that come too close.

    Attributes:
        links: Their names, ``spoon`` for the spoon.
        index: Row of the posture.
        distance_m: Distance [m]; negative when they overlap.
    """

    links: tuple[str, str]
    index: int
    distance_m: float


def spoon_mount(tool: ToolConfig) -> pinocchio.SE3:
    """Pose of ``spoon_link`` in the gripper's base link."""
    return pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -tool.mount_offset_m]))


class Clearance:
    """Checks postures for collisions of Talos with itself and with the spoon.

    Shapes are the convex hulls of the collision meshes, as the physics loads them, and the boxes of the spoon. Pairs
    that the SRDF excludes are not checked, nor are links of one gripper (their mimic joints are rigid in the model),
    nor the spoon with the hand and forearm that hold it, where the handle reaches into the fingers.

    Args:
        model: Talos with all joints.
        tool: Dimensions of the spoon.

    Raises:
        ConfigError: If the robot's meshes cannot be read.
    """

    def __init__(self, model: pinocchio.Model, tool: ToolConfig) -> None:
        self._model = model
        self._data = model.createData()
        try:
            geometry = pinocchio.buildGeomFromUrdf(
                model, str(urdf_path()), pinocchio.GeometryType.COLLISION, package_dirs=[str(share_directory())]
            )
        except (ValueError, RuntimeError) as error:
            raise ConfigError(f"{urdf_path()}: its meshes cannot be read: {error}") from error
        for shape in geometry.geometryObjects:
            if isinstance(shape.geometry, pinocchio.coal.BVHModelBase):
                shape.geometry.buildConvexHull(True, "Qt")
                shape.geometry = shape.geometry.convex
        geometry.addAllCollisionPairs()
        srdf = urdf_path().parent.parent / "srdf" / "talos.srdf"
        pinocchio.removeCollisionPairs(model, geometry, str(srdf), False)
        self.geometry = geometry
        self._links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
        for pair in list(geometry.collisionPairs):
            names = self._links[pair.first], self._links[pair.second]
            if any(all(name.startswith(hand) for name in names) for hand in _HANDS):
                geometry.removeCollisionPair(pair)
        self._add_spoon(tool)
        self._distances = geometry.createData()
        for request in self._distances.collisionRequests:
            request.security_margin = MARGIN_M
        self._broadphase = pinocchio.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geometry, self._distances)

    def first_approach(self, configurations: NDArray[np.float64]) -> Approach | None:
        """First posture in which two links are closer than `MARGIN_M`, and the closest links in it.

        Args:
            configurations: In the order of the model [rad], shape ``(n, 32)``.

        Returns:
            None when no posture has such links.
        """
        for index, configuration in enumerate(configurations):
            if pinocchio.computeCollisions(self._model, self._data, self._broadphase, configuration, True):
                pinocchio.computeDistances(self._model, self._data, self.geometry, self._distances, configuration)
                distances = [result.min_distance for result in self._distances.distanceResults]
                closest = int(np.argmin(distances))
                pair = self.geometry.collisionPairs[closest]
                return Approach(
                    links=(self._links[pair.first], self._links[pair.second]),
                    index=index,
                    distance_m=distances[closest],
                )
        return None

    def _add_spoon(self, tool: ToolConfig) -> None:
        frame = self._model.getFrameId(GRIPPER, pinocchio.BODY)
        gripper = self._model.frames[frame]
        others = [number for number, name in enumerate(self._links) if not name.startswith(_HOLDING)]
        for number, box in enumerate(boxes(tool)):
            placement = gripper.placement * spoon_mount(tool) * box.placement
            shape = pinocchio.GeometryObject(
                f"{SPOON}_{number}", gripper.parentJoint, frame, placement, pinocchio.coal.Box(*box.size)
            )
            added = self.geometry.addGeometryObject(shape)
            self._links.append(SPOON)
            for other in others:
                self.geometry.addCollisionPair(pinocchio.CollisionPair(other, added))
