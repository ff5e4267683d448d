"""Computes how close the links of a robot and its tool come to each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.tool_config import ToolConfig
from throwcollect.engines.body import LinkShape
from throwcollect.engines.engine import SceneBody
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError
from throwcollect.robots.joint_model import joint_model, mount_of, pose_of
from throwcollect.robots.robot import Robot
from throwcollect.robots.tools.tool import Tool, make_tool

MARGIN_M = 0.002
"""Least distance between links. On a path between two checked postures, which are 0.02 rad apart, the spoon, 1 m from
the torso's axis, could cut by this much into a body as curved as the head."""
_ROUNDING_M = 1e-5
"""Computed distances are right to a tenth of this."""
_TOUCHING_M = 1e-3
"""Bodies that touch may reach into each other by this much."""


@dataclass(frozen=True)
class Approach:
    """Two links that come too close.

    Attributes:
        links: Names of the two links; the tool counts as a link, by its own name.
        index: Row of the posture.
        distance_m: Distance of the links [m]; negative if they overlap.
    """

    links: tuple[str, str]
    index: int
    distance_m: float


class Clearance:
    """Checks postures for collisions of a robot with itself and its tool, or of both with the bodies of a scene.

    Shapes are the convex hulls of the collision meshes, as the physics loads them, and the boxes of the tool. Pairs
    that the SRDF excludes are not checked, nor are links of one gripper (their mimic joints are rigid in the model),
    nor the tool with the hand and forearm that hold it, where the handle reaches into the fingers.
    """

    def __init__(
        self,
        robot: Robot,
        model: pinocchio.Model,
        tool: ToolConfig,
        *,
        bodies: Sequence[SceneBody] = (),
        base_height_m: float = 0.0,
    ) -> None:
        self._robot, self._model = robot, model
        self._data = model.createData()
        # Copies share the shapes and have pairs of their own.
        geometry = self.geometry = pinocchio.GeometryModel(read_shapes(robot))
        self._links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
        for pair in list(geometry.collisionPairs):
            names = self._links[pair.first], self._links[pair.second]
            if any(all(name.startswith(group) for name in names) for group in robot.rigid):
                geometry.removeCollisionPair(pair)
        self._add_tool(make_tool(tool))
        if bodies:
            geometry.removeAllCollisionPairs()
        for body in bodies:
            self._add_body(body, base_height_m)
        self._distances = geometry.createData()
        for request in self._distances.collisionRequests:
            request.security_margin = MARGIN_M
        self._broadphase = pinocchio.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geometry, self._distances)

    def first_approach(self, configurations: NDArray[np.float64]) -> Approach | None:
        """Find the first posture in which two links are closer than `MARGIN_M`, and the closest links in it, if any.

        Args:
            configurations: In the order of the model [rad], shape ``(n, n_joints)``.
        """
        for index, posture in enumerate(configurations):
            # The tree finds quickly whether any links are too close, but the message has to name the links.
            if pinocchio.computeCollisions(self._model, self._data, self._broadphase, posture, True):
                pinocchio.computeDistances(self._model, self._data, self.geometry, self._distances, posture)
                distances = [result.min_distance for result in self._distances.distanceResults]
                closest = int(np.argmin(distances))
                pair = self.geometry.collisionPairs[closest]
                return Approach(
                    links=(self._links[pair.first], self._links[pair.second]),
                    index=index,
                    distance_m=distances[closest],
                )
        return None

    def find_clear(
        self,
        rest: NDArray[np.float64],
        moving: NDArray[np.intp],
        ways: NDArray[np.float64],
        trials: NDArray[np.intp],
        n_trials: int,
    ) -> NDArray[np.bool_]:
        """Find the trials in all of whose postures links surely stay `MARGIN_M` apart, shape ``(n_trials,)``.

        Links that are farther apart, in the middle of a box of postures, than they can approach each other within the
        box, need no further look; a box with other links is cut in two. So similar trials share most of the work.

        Args:
            rest: A posture in the order of the model [rad], shape ``(n_joints,)``.
            moving: Columns of joints that move, shape ``(n_moving,)``.
            ways: Their positions in each posture, shape ``(n_moving, n)``.
            trials: The trial of each posture, shape ``(n,)``.
            n_trials: Number of trials.
        """
        clear, posture, reaches = np.ones(n_trials, np.bool_), rest.copy(), self._reaches[:, moving]
        boxes = [(ways, trials, np.arange(len(reaches)))]
        while boxes:
            inside, owners, pairs = boxes.pop()
            if not len(owners):
                continue
            low, high = inside.min(axis=1), inside.max(axis=1)
            posture[moving] = middle = (low + high) / 2
            approaches = reaches[pairs] * ((high - low) / 2)
            pinocchio.updateGeometryPlacements(self._model, self._data, self.geometry, self._distances, posture)
            of_pair = (pinocchio.computeDistance(self.geometry, self._distances, pair) for pair in pairs.tolist())
            gaps = np.array([found.min_distance for found in of_pair])
            near = gaps - approaches.sum(axis=1) <= MARGIN_M + _ROUNDING_M
            if near.any():
                joint = int(approaches[near].max(axis=0).argmax())
                if approaches[near, joint].max() <= _ROUNDING_M:
                    clear[owners] = False
                    continue
                lower, left = inside[joint] <= middle[joint], clear[owners]
                boxes += [
                    (inside.compress(half, axis=1), owners.compress(half), pairs[near])
                    for half in (lower & left, ~lower & left)
                ]
        return clear

    @cached_property
    def _reaches(self) -> NDArray[np.float64]:
        """How far links of a pair can approach each other by a joint [m/rad; m/m], shape ``(n_pairs, n_joints)``."""
        model, shapes = self._model, self.geometry.geometryObjects
        reaches = np.zeros((len(shapes), model.nq))
        for shape, reach in zip(shapes, reaches, strict=True):
            shape.geometry.computeLocalAABB()
            # In the worst case, the arm is stretched from the joint to the farthest point of the shape.
            length, joint = math.hypot(*shape.placement.act(shape.geometry.aabb_center)), shape.parentJoint
            length += shape.geometry.aabb_radius
            while joint:
                column = model.idx_qs[joint]
                slides = model.names[joint] in self._robot.sliding
                reach[column] = 1.0 if slides else length
                length += math.hypot(*model.jointPlacements[joint].translation)
                if slides:
                    length += max(abs(model.lowerPositionLimit[column]), abs(model.upperPositionLimit[column]))
                joint = model.parents[joint]
        # A joint that moves both links does not change their distance.
        pairs = np.array([(pair.first, pair.second) for pair in self.geometry.collisionPairs]).reshape(-1, 2)
        one, other = reaches[pairs].transpose(1, 0, 2)
        return np.where((one > 0) & (other > 0), 0.0, one + other)

    def _add_tool(self, tool: Tool) -> None:
        frame = self._model.getFrameId(self._robot.hand, pinocchio.BODY)
        hand = self._model.frames[frame]
        others = [number for number, name in enumerate(self._links) if not self._robot.holds(name)]
        for number, box in enumerate(tool.boxes):
            placement = hand.placement * mount_of(self._robot, tool) * box.placement
            shape = pinocchio.GeometryObject(
                f"{tool.name}_{number}", hand.parentJoint, frame, placement, pinocchio.coal.Box(*box.size)
            )
            added = self.geometry.addGeometryObject(shape)
            self._links.append(tool.name)
            for other in others:
                self.geometry.addCollisionPair(pinocchio.CollisionPair(other, added))

    def _add_body(self, body: SceneBody, base_height_m: float) -> None:
        """Add a body, which stands in the world, while the model's origin is the robot's base."""
        place = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -base_height_m])) * pose_of(body.placement)
        robot = [number for number, shape in enumerate(self.geometry.geometryObjects) if shape.parentFrame]
        for number, shape in enumerate(body.link.shapes):
            solid, pose = _make_solid(body.link.name, shape), place * pose_of(shape.placement)
            added = self.geometry.addGeometryObject(
                pinocchio.GeometryObject(f"scene/{body.link.name}_{number}", 0, 0, pose, solid)
            )
            self._links.append(body.link.name)
            for other in robot:
                self.geometry.addCollisionPair(pinocchio.CollisionPair(other, added))


@lru_cache(maxsize=8)
def find_overlap(bodies: tuple[SceneBody, ...]) -> str | None:
    """Explain which two bodies, of which one moves, overlap; None if none do."""
    solids = []
    for body in bodies:
        for shape in body.link.shapes:
            pose, solid = pose_of(body.placement) * pose_of(shape.placement), _make_solid(body.link.name, shape)
            place = pinocchio.coal.Transform3s(pose.rotation, pose.translation)
            solids.append((body, pinocchio.coal.CollisionObject(solid, place)))
    request, result = pinocchio.coal.DistanceRequest(), pinocchio.coal.DistanceResult()
    for (one, solid), (other, second) in combinations(solids, 2):
        if one is not other and (one.moves or other.moves):
            result.clear()
            if (depth_m := -pinocchio.coal.distance(solid, second, request, result)) > _TOUCHING_M:
                return f"{one.link.name} and {other.link.name} overlap by {depth_m * 1000:.3g} mm at the start"
    return None


@lru_cache(maxsize=4)
def read_shapes(robot: Robot) -> pinocchio.GeometryModel:
    """Read the shapes of a robot's links, and the pairs that must stay apart; callers must not change the result.

    The result is cached, because reading meshes takes a third of a second, and some programs check several datasets.
    """
    model, geometry = joint_model(robot), pinocchio.GeometryModel()
    frames = {model.getFrameId(link.name, pinocchio.BODY): link for link in robot.description.model.links}
    for frame, link in sorted(frames.items()):
        link_pose = model.frames[frame].placement
        for number, shape in enumerate(link.shapes):
            pose = link_pose * pose_of(shape.placement)
            solid = _make_solid(f"{robot.urdf_path}: link {link.name}", shape)
            joint = model.frames[frame].parentJoint
            geometry.addGeometryObject(pinocchio.GeometryObject(f"{link.name}_{number}", joint, frame, pose, solid))
    geometry.addAllCollisionPairs()
    # While a robot is imported, there is no SRDF yet.
    if robot.srdf_path.is_file():
        pinocchio.removeCollisionPairs(model, geometry, str(robot.srdf_path), False)
    return geometry


def _make_solid(where: str, shape: LinkShape) -> pinocchio.coal.CollisionGeometry:
    """Make a shape for computing distances; that of a mesh is its convex hull, as in the physics."""
    coal = pinocchio.coal
    if shape.mesh is None:
        kinds = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
        return kinds[shape.kind](*shape.size)
    try:
        return shape.mesh.find_hull(shape.size)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error.message}") from error
