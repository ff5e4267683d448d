"""Sets up a Bullet world: ground, robot with its tool, the object, and bodies of the scene.

Only the object and bodies that move collide with other things. Shapes of a robot may overlap each other at rest, and
with these few pairs the order in which Bullet solves contacts does not depend on earlier trials.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pybullet

from throwcollect.engines.body import BodyModel, Vector
from throwcollect.engines.engine import (
    GROUND,
    UPRIGHT,
    BodyState,
    LoadedRobot,
    Physics,
    Quaternion,
    Sample,
    Scene,
    SceneBody,
    body_of,
)
from throwcollect.engines.grip import ANY_INERTIA, HELD_LINK, add_held_link
from throwcollect.engines.native_reading import reading_natively
from throwcollect.errors import ConfigError, WorkerError

Surface = tuple[int, int]
"""Body and link number in Bullet."""

BASE = -1
"""Link number of the first link of a body."""

_GROUND_GROUP, _ROBOT_GROUP, _OBJECT_GROUP, _MOVING_GROUP, _FLOOR_GROUP = 1, 2, 4, 8, 16
"""Bullet lets a pair collide if the mask of either one has the group of the other; the floor is a ground that is not
solid."""


_KINDS = {"box": pybullet.GEOM_BOX, "cylinder": pybullet.GEOM_CYLINDER, "sphere": pybullet.GEOM_SPHERE}
_SIZES = {"box": (), "cylinder": ("radius", "height"), "sphere": ("radius",)}
"""Types of the shapes that an object has, and names of their sizes; a box has half of its edges."""


@dataclass(frozen=True)
class Scenery:
    """The parts of a world that stay the same from trial to trial: ground and robot.

    Attributes:
        robot: Body number of the robot.
        joints: Joint numbers of the moving joints, in the order of the scene.
        tool: Link number of the tool.
        held: Link number of the link that has the mass of an object that the tool holds; None if it cannot hold any.
        names: Name of each surface that can press on the object: the ground, the tool or a link of the robot.
    """

    robot: int
    joints: list[int]
    tool: int
    held: int | None
    names: dict[Surface, str]


class World:
    """The functions of Bullet, for an empty world in this process.

    Raises:
        WorkerError: If Bullet refuses to start another world in this process.
    """

    def __init__(self) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise WorkerError("Bullet could not start a physics world", hint="close other worlds of this process")

    def __getattr__(self, name: str) -> Any:
        """Bind a function of Bullet to this world."""
        bound = partial(getattr(pybullet, name), physicsClientId=self._client)
        setattr(self, name, bound)
        return bound


def load_scenery(world: World, scene: Scene) -> Scenery:
    """Empty the world and load ground and robot into it."""
    world.resetSimulation()
    plane = world.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0, 0, 1])
    ground = world.createMultiBody(0, plane)
    # By default Bullet computes inertias from the collision shapes.
    robot = _load_model(world, add_held_link(scene.robot, scene.tool), (0.0, 0.0, scene.base_height_m))
    root = world.getBodyInfo(robot)[0].decode()
    joints, names = {}, {(ground, BASE): GROUND, (robot, BASE): root}
    for number in range(world.getNumJoints(robot)):
        info = world.getJointInfo(robot, number)
        # Field 1 is the name of the joint, field 12 the name of the link that it moves.
        joints[info[1].decode()] = number
        names[robot, number] = info[12].decode()
    tool = next(link for (_, link), name in names.items() if name == scene.tool.link)
    names[robot, tool] = scene.tool.name
    for body, link in names:
        group, mask = _ROBOT_GROUP, _OBJECT_GROUP
        if body == ground:
            group, mask = (_GROUND_GROUP, _OBJECT_GROUP) if scene.ground_is_solid else (_FLOOR_GROUP, 0)
        world.setCollisionFilterGroupMask(body, link, group, mask)
    held = joints.get(HELD_LINK)
    return Scenery(robot, [joints[joint] for joint in scene.moving], tool, held, names)


def _load_model(
    world: World, model: BodyModel, position: Vector, turn: Quaternion = UPRIGHT, *, moves: bool = False
) -> int:
    """Load a tree of links at a pose in world, whose root does not move by default; return its body number."""
    # Bullet reads descriptions and meshes from files alone. Meshes are named relative to the description.
    with tempfile.TemporaryDirectory(prefix="throwcollect-") as directory:
        for name, content in model.encode_meshes().items():
            Path(directory, name).write_bytes(content)
        path = Path(directory, "body.urdf")
        path.write_text(model.write_urdf(), encoding="utf-8")
        flags, fixed = pybullet.URDF_USE_INERTIA_FROM_FILE, not moves
        with reading_natively():
            try:
                return int(world.loadURDF(str(path), position, turn, 0, fixed, flags))
            except pybullet.error as error:
                raise ConfigError(f"Bullet cannot load the description: {error}") from error


def describe(world: World, scenery: Scenery, positions: Sequence[float]) -> LoadedRobot:
    """Describe a robot with its moving joints at some positions (see `Engine.describe_robot`)."""
    robot = scenery.robot
    infos = [world.getJointInfo(robot, number) for number in range(world.getNumJoints(robot))]
    names = [world.getBodyInfo(robot)[0], *(info[12] for info in infos)]
    shapes = {
        name.decode(): len(world.getCollisionShapeData(robot, number)) for number, name in enumerate(names, start=BASE)
    }
    # Field 3 is the place of a joint among positions; the first 7 are those of a base that could move.
    columns = [infos[joint][3] - 7 for joint in scenery.joints]
    posture = [0.0] * len(positions)
    for joint, column, position in zip(scenery.joints, columns, positions, strict=True):
        posture[column] = position
        world.resetJointState(robot, joint, position)
    matrix = np.array(world.calculateMassMatrix(robot, posture))[np.ix_(columns, columns)]
    state = world.getLinkState(robot, scenery.tool, computeForwardKinematics=True)
    return LoadedRobot(shapes, matrix, state[4])


def load_bodies(world: World, bodies: Sequence[SceneBody]) -> dict[int, SceneBody]:
    """Put bodies into the world, and return them by their body numbers."""
    numbers = {}
    for body in bodies:
        # Bullet complains of links without a mass; that of a body that never moves does not matter.
        link = body.link if body.moves else replace(body.link, inertia=ANY_INERTIA)
        at = body_of(body.start)
        model = BodyModel(link.name, (link,))
        number = _load_model(world, model, at.position, at.orientation_xyzw, moves=body.moves)
        if not body.moves:
            world.setCollisionFilterGroupMask(number, BASE, _ROBOT_GROUP, _OBJECT_GROUP)
        if any(shape.mesh is not None for shape in link.shapes):
            # Around a hull, Bullet would leave a margin of 1 mm.
            world.changeDynamics(number, BASE, collisionMargin=0.0)
        numbers[number] = body
    return numbers


def place_body(world: World, number: int, body: SceneBody, state: BodyState) -> None:
    """Set pose and velocity of a body, whose centre of mass Bullet places."""
    place, turn, linear = state.position, state.orientation_xyzw, state.linear_velocity
    if not body.inertia.is_centred:
        centre, axes = world.getDynamicsInfo(number, BASE)[3:5]
        place, turn = world.multiplyTransforms(place, turn, centre, axes)
        linear = _move_velocity(linear, state.angular_velocity, state.position, place)
    world.resetBasePositionAndOrientation(number, place, turn)
    world.resetBaseVelocity(number, linear, state.angular_velocity)


def find_origin(world: World, number: int, numbers: Sample) -> Sample:
    """Compute the numbers of a sample for the origin of a body from those for its centre of mass."""
    centre = body_of(numbers)
    frame = world.getDynamicsInfo(number, BASE)[3:5]
    back = world.invertTransform(*frame)
    place, turn = world.multiplyTransforms(centre.position, centre.orientation_xyzw, *back)
    linear = _move_velocity(centre.linear_velocity, centre.angular_velocity, centre.position, place)
    return (*place, *turn, *linear, *centre.angular_velocity)


def _move_velocity(linear: Vector, angular: Vector, at: Vector, to: Vector) -> Vector:
    """Compute the velocity of another point of a body that turns."""
    (a, b, c), (x, y, z) = angular, (to[axis] - at[axis] for axis in range(3))
    return linear[0] + b * z - c * y, linear[1] + c * x - a * z, linear[2] + a * y - b * x


def renew_moving(world: World, body: int) -> None:
    """Let a body that moves collide with everything; Bullet then forgets all contacts that it had."""
    everything = _GROUND_GROUP | _ROBOT_GROUP | _OBJECT_GROUP | _MOVING_GROUP | _FLOOR_GROUP
    world.setCollisionFilterGroupMask(body, BASE, _MOVING_GROUP, everything)


def load_object(world: World, body: SceneBody) -> int:
    """Put the object into the world, far above everything else, and return its body number.

    Its sizes cannot be changed later.
    """
    (shape,) = body.link.shapes
    size: dict[str, Any] = dict(zip(_SIZES[shape.kind], shape.size, strict=False))
    if shape.kind == "box":
        size["halfExtents"] = [edge / 2 for edge in shape.size]
    number = world.createCollisionShape(_KINDS[shape.kind], **size)
    object_id = int(world.createMultiBody(1, number, basePosition=[0, 0, 100]))
    renew_pairs(world, object_id)
    return object_id


def renew_pairs(world: World, object_id: int, *, floor: bool = False) -> None:
    """Let the object collide with everything, or also with a floor; Bullet then forgets all contacts that it had."""
    mask = _GROUND_GROUP | _ROBOT_GROUP | (_FLOOR_GROUP if floor else 0)
    world.setCollisionFilterGroupMask(object_id, BASE, _OBJECT_GROUP, mask)


def set_physics(world: World, scenery: Scenery, bodies: Mapping[int, SceneBody], physics: Physics) -> None:
    """Set time step, solver, gravity and surfaces, also of bodies by their numbers, so that no earlier ones stay."""
    world.setPhysicsEngineParameter(
        fixedTimeStep=1 / physics.hz,
        numSolverIterations=physics.solver_iterations,
        # Otherwise friction acts along two directions separately, and turns what slides between them.
        enableConeFriction=1,
        # Bullet sorts the pairs of shapes, so that contacts are solved in the same order each time.
        deterministicOverlappingPairs=1,
    )
    world.setGravity(0, 0, -physics.gravity_mps2)
    # Bullet's default damping of 0.04/s has no physical cause and would shorten a throw by 6 cm.
    undamped = {"linearDamping": 0, "angularDamping": 0}
    for body, link in scenery.names:
        # Bullet multiplies restitutions: with 1 here, only the restitution of the object counts.
        world.changeDynamics(body, link, lateralFriction=physics.surface_friction, restitution=1, **undamped)
    for number, each in bodies.items():
        rolling = dict.fromkeys(("rollingFriction", "spinningFriction"), each.rolling_friction_m)
        surface = {"lateralFriction": each.friction, "restitution": each.restitution, **rolling}
        world.changeDynamics(number, BASE, **surface, **undamped)
