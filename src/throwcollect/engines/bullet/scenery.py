"""Sets up a Bullet world: ground, robot with its tool, the object, and bodies of the scene.

Only the object and bodies that move collide with other things. Shapes of a robot may overlap each other at rest, and
with these few pairs the order in which Bullet solves contacts does not depend on earlier trials.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

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


def connect() -> int:
    """Start an empty world in this process, and return the number of its physics client."""
    client = int(pybullet.connect(pybullet.DIRECT))
    if client < 0:
        raise WorkerError("Bullet could not start a physics world", hint="close other worlds of this process")
    return client


def load_scenery(client: int, scene: Scene) -> Scenery:
    """Empty the world and load ground and robot into it."""
    pybullet.resetSimulation(physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0, 0, 1], physicsClientId=client)
    ground = pybullet.createMultiBody(0, plane, physicsClientId=client)
    # By default Bullet computes inertias from the collision shapes.
    robot = _load_model(client, add_held_link(scene.robot, scene.tool), (0.0, 0.0, scene.base_height_m))
    root = pybullet.getBodyInfo(robot, physicsClientId=client)[0].decode()
    joints = {}
    names = {(ground, BASE): GROUND, (robot, BASE): root}
    for number in links(client, robot)[1:]:
        info = pybullet.getJointInfo(robot, number, physicsClientId=client)
        # Field 1 is the name of the joint, field 12 the name of the link that it moves.
        joints[info[1].decode()] = number
        names[robot, number] = info[12].decode()
    tool = next(link for (_, link), name in names.items() if name == scene.tool.link)
    names[robot, tool] = scene.tool.name
    for body, link in names:
        group, mask = _ROBOT_GROUP, _OBJECT_GROUP
        if body == ground:
            group, mask = (_GROUND_GROUP, _OBJECT_GROUP) if scene.ground_is_solid else (_FLOOR_GROUP, 0)
        pybullet.setCollisionFilterGroupMask(body, link, group, mask, physicsClientId=client)
    held = joints.get(HELD_LINK)
    return Scenery(robot, [joints[joint] for joint in scene.moving], tool, held, names)


def _load_model(
    client: int, model: BodyModel, position: Vector, turn: Quaternion = UPRIGHT, *, moves: bool = False
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
                return int(pybullet.loadURDF(str(path), position, turn, 0, fixed, flags, physicsClientId=client))
            except pybullet.error as error:
                raise ConfigError(f"Bullet cannot load the description: {error}") from error


def describe(client: int, scenery: Scenery, positions: Sequence[float]) -> LoadedRobot:
    """Describe a robot with its moving joints at some positions (see `Engine.describe_robot`)."""
    robot, given = scenery.robot, {"physicsClientId": client}
    infos = [pybullet.getJointInfo(robot, number, **given) for number in links(client, robot)[1:]]
    names = [pybullet.getBodyInfo(robot, **given)[0], *(info[12] for info in infos)]
    shapes = {
        name.decode(): len(pybullet.getCollisionShapeData(robot, number, **given))
        for number, name in enumerate(names, start=BASE)
    }
    # Field 3 is the place of a joint among positions; the first 7 are those of a base that could move.
    columns = [infos[joint][3] - 7 for joint in scenery.joints]
    posture = [0.0] * len(positions)
    for joint, column, position in zip(scenery.joints, columns, positions, strict=True):
        posture[column] = position
        pybullet.resetJointState(robot, joint, position, **given)
    matrix = np.array(pybullet.calculateMassMatrix(robot, posture, **given))[np.ix_(columns, columns)]
    state = pybullet.getLinkState(robot, scenery.tool, computeForwardKinematics=True, **given)
    return LoadedRobot(shapes, matrix, state[4])


def load_bodies(client: int, bodies: Sequence[SceneBody]) -> dict[int, SceneBody]:
    """Put bodies into the world, and return them by their body numbers."""
    numbers = {}
    for body in bodies:
        # Bullet complains of links without a mass; that of a body that never moves does not matter.
        link = body.link if body.moves else replace(body.link, inertia=ANY_INERTIA)
        at = body_of(body.start)
        model = BodyModel(link.name, (link,))
        number = _load_model(client, model, at.position, at.orientation_xyzw, moves=body.moves)
        if not body.moves:
            pybullet.setCollisionFilterGroupMask(number, BASE, _ROBOT_GROUP, _OBJECT_GROUP, physicsClientId=client)
        if any(shape.mesh is not None for shape in link.shapes):
            # Around a hull, Bullet would leave a margin of 1 mm.
            pybullet.changeDynamics(number, BASE, collisionMargin=0.0, physicsClientId=client)
        numbers[number] = body
    return numbers


def place_body(client: int, number: int, body: SceneBody, state: BodyState) -> None:
    """Set pose and velocity of a body, whose centre of mass Bullet places."""
    place, turn, linear = state.position, state.orientation_xyzw, state.linear_velocity
    if not body.inertia.is_centred:
        centre, axes = pybullet.getDynamicsInfo(number, BASE, physicsClientId=client)[3:5]
        place, turn = pybullet.multiplyTransforms(place, turn, centre, axes)
        linear = _move_velocity(linear, state.angular_velocity, state.position, place)
    pybullet.resetBasePositionAndOrientation(number, place, turn, physicsClientId=client)
    pybullet.resetBaseVelocity(number, linear, state.angular_velocity, physicsClientId=client)


def find_origin(client: int, number: int, numbers: Sample) -> Sample:
    """Compute the numbers of a sample for the origin of a body from those for its centre of mass."""
    centre = body_of(numbers)
    frame = pybullet.getDynamicsInfo(number, BASE, physicsClientId=client)[3:5]
    back = pybullet.invertTransform(*frame)
    place, turn = pybullet.multiplyTransforms(centre.position, centre.orientation_xyzw, *back)
    linear = _move_velocity(centre.linear_velocity, centre.angular_velocity, centre.position, place)
    return (*place, *turn, *linear, *centre.angular_velocity)


def _move_velocity(linear: Vector, angular: Vector, at: Vector, to: Vector) -> Vector:
    """Compute the velocity of another point of a body that turns."""
    (a, b, c), (x, y, z) = angular, (to[axis] - at[axis] for axis in range(3))
    return linear[0] + b * z - c * y, linear[1] + c * x - a * z, linear[2] + a * y - b * x


def renew_moving(client: int, body: int) -> None:
    """Let a body that moves collide with everything; Bullet then forgets all contacts that it had."""
    everything = _GROUND_GROUP | _ROBOT_GROUP | _OBJECT_GROUP | _MOVING_GROUP | _FLOOR_GROUP
    pybullet.setCollisionFilterGroupMask(body, BASE, _MOVING_GROUP, everything, physicsClientId=client)


def load_object(client: int, body: SceneBody) -> int:
    """Put the object into the world, far above everything else, and return its body number.

    Its sizes cannot be changed later.
    """
    (shape,) = body.link.shapes
    names = _SIZES[shape.kind]
    size = (
        {"halfExtents": [edge / 2 for edge in shape.size]} if not names else dict(zip(names, shape.size, strict=True))
    )
    number = pybullet.createCollisionShape(_KINDS[shape.kind], physicsClientId=client, **size)
    object_id = int(pybullet.createMultiBody(1, number, basePosition=[0, 0, 100], physicsClientId=client))
    renew_pairs(client, object_id)
    return object_id


def renew_pairs(client: int, object_id: int, *, floor: bool = False) -> None:
    """Let the object collide with everything, or also with a floor; Bullet then forgets all contacts that it had."""
    mask = _GROUND_GROUP | _ROBOT_GROUP | (_FLOOR_GROUP if floor else 0)
    pybullet.setCollisionFilterGroupMask(object_id, BASE, _OBJECT_GROUP, mask, physicsClientId=client)


def links(client: int, body: int) -> range:
    """List the link numbers of a body, that of its base included."""
    return range(BASE, pybullet.getNumJoints(body, physicsClientId=client))


def set_physics(client: int, scenery: Scenery, bodies: Mapping[int, SceneBody], physics: Physics) -> None:
    """Set time step, solver, gravity and surfaces, also of bodies by their numbers, so that no earlier ones stay."""
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=1 / physics.hz,
        numSolverIterations=physics.solver_iterations,
        # Otherwise friction acts along two directions separately, and turns what slides between them.
        enableConeFriction=1,
        # Bullet sorts the pairs of shapes, so that contacts are solved in the same order each time.
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    pybullet.setGravity(0, 0, -physics.gravity_mps2, physicsClientId=client)
    # Bullet's default damping of 0.04/s has no physical cause and would shorten a throw by 6 cm.
    undamped = {"linearDamping": 0, "angularDamping": 0}
    for body, link in scenery.names:
        # Bullet multiplies restitutions: with 1 here, only the restitution of the object counts.
        pybullet.changeDynamics(
            body,
            link,
            lateralFriction=physics.surface_friction,
            restitution=1,
            physicsClientId=client,
            **undamped,
        )
    for number, each in bodies.items():
        pybullet.changeDynamics(
            number,
            BASE,
            lateralFriction=each.friction,
            restitution=each.restitution,
            rollingFriction=each.rolling_friction_m,
            spinningFriction=each.rolling_friction_m,
            physicsClientId=client,
            **undamped,
        )
