"""Sets up a MuJoCo world: ground, robot with its tool, the object, and bodies of the scene.

As in Bullet, only the object and bodies that move collide with other things.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import BodyModel, LinkShape, Vector, turn_of
from throwcollect.engines.engine import GROUND, Physics, Scene, SceneBody
from throwcollect.engines.grip import HELD_LINK, add_held_link
from throwcollect.engines.mujoco.stepping import HARDNESS, ROLLING_ROWS, SLIDING_ROWS
from throwcollect.errors import ConfigError

_KINDS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
}
"""Types of the shapes that bodies of a scene have."""

OBJECT = "object"
"""Name of the object's body and shape in the model."""

_GROUND_BIT, _ROBOT_BIT, _FLOOR_BIT = 1, 2, 4
"""Bits of ``contype`` and ``conaffinity``: a pair collides if the one's type is among those that the other collides
with."""

_OBJECT_HITS = _GROUND_BIT | _ROBOT_BIT
_REACH_M = 0.02
"""MuJoCo makes a contact of shapes at this distance, so that nothing fast gets inside of a shape in one step."""

_OBJECT_PRIORITY = 1
"""The highest priority: friction and restitution of a contact are those of the object, whatever it touches."""

# Without these options MuJoCo cuts the directories off the names of meshes, and merges links that are fixed to their
# parents.
_COMPILER = '<mujoco><compiler strippath="false" discardvisual="true" fusestatic="false"/></mujoco>'
_ROOT_TAG_END = ">"

_WORLD_LINK, _STAND_IN = "world", "world of the robot"
"""MuJoCo takes a root link of this name for the world itself, which is at height 0; so that link has another name."""


def _read_robot(model: BodyModel) -> mujoco.MjSpec:
    """Read the robot, whose links all become bodies of MuJoCo."""
    text = model.write_urdf()
    begin = text.index("<robot")
    at = text.index(_ROOT_TAG_END, begin) + 1
    spec = mujoco.MjSpec.from_string(text[:at] + _COMPILER + text[at:], assets=model.encode_meshes())
    for joint in spec.joints:
        # A motor overcomes the friction of its joint, as in Bullet.
        joint.frictionloss = 0.0
    return spec


def make_spec(scene: Scene) -> tuple[mujoco.MjSpec, list[str]]:
    """Put ground, robot, object and bodies together.

    Returns:
        The world, and names in contacts of what can press on the object; each is a body with all its shapes.
    """
    try:
        robot = add_held_link(scene.robot, scene.tool).rename_links({_WORLD_LINK: _STAND_IN})
        spec = _read_robot(robot)
    except ValueError as error:
        raise ConfigError(f"MuJoCo cannot read the robot's description: {error}") from error
    world = spec.worldbody
    world.first_body().pos = (0.0, 0.0, scene.base_height_m)
    surfaces = {world.name: GROUND}
    names = {scene.tool.link: scene.tool.name, _STAND_IN: _WORLD_LINK}
    for body in spec.bodies[1:]:
        surfaces[body.name] = names.get(body.name, body.name)
        for geom in body.geoms:
            geom.contype, geom.conaffinity = _ROBOT_BIT, 0
    world.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        # Half sizes of 0 make the plane infinite. The third number is the spacing of its grid in pictures.
        size=(0.0, 0.0, 1.0),
        contype=_GROUND_BIT if scene.ground_is_solid else _FLOOR_BIT,
        conaffinity=0,
    )
    _add_object(spec, scene.object)
    if scene.moving_bodies:
        for number, geom in enumerate(spec.geoms):
            geom.name = geom.name or f"robot/{number}"
    # Those that move are last, so that their pairs with all others can be named.
    for each in sorted(scene.bodies, key=lambda body: body.moves):
        _add_body(spec, each)
        surfaces[_name_body(each)] = each.link.name
    for body in surfaces:
        _watch(spec, body)
    option = spec.option
    # `MujocoEngine.run` relies on damping that acts on the velocity after the step.
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # `aim_contacts` relies on one row for each direction of a contact, which pyramidal cones do not have.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # MuJoCo would reset a world that diverges. Without that, its numbers are not finite, and the trial is refused.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return spec, list(surfaces.values())


def _add_object(spec: mujoco.MjSpec, body: SceneBody) -> None:
    """Put the object into the world; `set_physics` sets its mass and its surface."""
    added = spec.worldbody.add_body(name=OBJECT)
    added.add_freejoint(name=OBJECT)
    (shape,) = body.link.shapes
    added.add_geom(
        name=OBJECT,
        type=_KINDS[shape.kind],
        size=_size(shape)[0],
        mass=1.0,
        contype=0,
        conaffinity=_OBJECT_HITS,
        priority=_OBJECT_PRIORITY,
    )


def _add_body(spec: mujoco.MjSpec, body: SceneBody) -> None:
    """Put a body into the world; `place_bodies` sets its pose and, if it is plain, its sizes and its mass.

    Pairs of shapes that collide are named one by one, as they have numbers of their own: the object with every body,
    and a body that moves with everything that is in the world already.
    """
    name, link = _name_body(body), body.link
    others = [geom.name for geom in spec.geoms] if body.moves else [OBJECT]
    added = spec.worldbody.add_body(name=name)
    if body.moves:
        added.add_freejoint(name=name)
    if link.inertia is not None and not link.is_plain:
        added.explicitinertial, added.mass, added.ipos = True, link.inertia.mass_kg, link.inertia.placement.xyz
        # The axes of the six moments are those of the placement. MuJoCo has the diagonal first.
        added.fullinertia = [link.inertia.moments_kgm2[number] for number in (0, 3, 5, 1, 2, 4)]
    for number, shape in enumerate(link.shapes):
        geom = f"{name}/{number}"
        x, y, z, w = turn_of(shape.placement)
        form = {"pos": shape.placement.xyz, "quat": (w, x, y, z), "mass": 1.0, "contype": 0, "conaffinity": 0}
        if shape.mesh is None:
            size = (1.0, 1.0, 1.0) if link.is_plain else _size(shape)[0]
            added.add_geom(name=geom, type=_KINDS[shape.kind], size=size, **form)
        else:
            # Without faces, MuJoCo makes the convex hull.
            spec.add_mesh(name=geom, uservert=(shape.mesh.corners * shape.size).ravel())
            added.add_geom(name=geom, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=geom, **form)
        for other in others:
            spec.add_pair(geomname1=other, geomname2=geom, condim=SLIDING_ROWS, margin=_REACH_M)


def _name_body(body: SceneBody) -> str:
    """Name a body of the scene in the model, where a link of the robot may have the same name."""
    return f"scene/{body.link.name}"


def place_bodies(model: mujoco.MjModel, bodies: Sequence[SceneBody]) -> None:
    """Give bodies their poses, and plain ones their sizes, as if the model had been compiled with them."""
    for each in bodies:
        body = model.body(_name_body(each)).id
        x, y, z, w = turn_of(each.placement)
        model.body_pos[body], model.body_quat[body] = each.placement.xyz, (w, x, y, z)
        if not each.link.is_plain:
            continue
        if (inertia := each.link.inertia) is not None:
            model.body_mass[body] = inertia.mass_kg
            model.body_inertia[body] = inertia.diagonal
        for number, shape in enumerate(each.link.shapes):
            geom = model.geom(f"{_name_body(each)}/{number}").id
            _resize(model, geom, shape)


def _resize(model: mujoco.MjModel, geom: int, shape: LinkShape) -> None:
    size, half = _size(shape)
    model.geom_size[geom] = size
    model.geom_aabb[geom, 3:] = half
    model.geom_rbound[geom] = shape.radius_m


def _size(shape: LinkShape) -> tuple[Vector, Vector]:
    """Size of a shape as MuJoCo has it, and half of the edges of the box around it [m]."""
    match shape.kind, shape.size:
        case "box", (x, y, z):
            return (x / 2, y / 2, z / 2), (x / 2, y / 2, z / 2)
        case "cylinder", (radius, length):
            return (radius, length / 2, 0.0), (radius, radius, length / 2)
        case "sphere", (radius,):
            return (radius, 0.0, 0.0), (radius, radius, radius)
    raise ValueError(shape.kind)


def _watch(spec: mujoco.MjSpec, body: str) -> None:
    """Add a sensor of the force with which a body presses on the object; its first number is the normal force."""
    # The sensor reports the force of one contact: of all between the two bodies, the strongest.
    force, strongest, one = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 2, 1
    spec.add_sensor(
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=OBJECT,
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname=body,
        intprm=(force, strongest, one),
    )


def resize_object(model: mujoco.MjModel, body: SceneBody) -> None:
    """Give the object other sizes, as if the model had been compiled with them."""
    geom, number = model.geom(OBJECT).id, model.body(OBJECT).id
    (shape,) = body.link.shapes
    _resize(model, geom, shape)
    model.bvh_aabb[model.body_bvhadr[number], 3:] = model.geom_aabb[geom, 3:]
    first = model.body_dofadr[number]
    model.dof_length[first + 3 : first + 6] = model.geom_rbound[geom]


def find_reach(model: mujoco.MjModel) -> float:
    """Find the distance from the object's centre beyond which MuJoCo makes no contacts of it [m]."""
    return float(model.geom_rbound[model.geom(OBJECT).id]) + 2 * _REACH_M


def weigh_held(model: mujoco.MjModel, *, is_held: bool) -> None:
    """Give the link of the held object the mass and the inertia of the object, or none."""
    link, held = model.body(HELD_LINK).id, model.body(OBJECT).id
    model.body_mass[link] = model.body_mass[held] * is_held
    model.body_inertia[link] = model.body_inertia[held] * is_held


def let_object_hit_floor(model: mujoco.MjModel, *, floor: bool) -> None:
    """Let the object collide with a ground that is not solid, too, or not."""
    hits = _OBJECT_HITS | (_FLOOR_BIT if floor else 0)
    # MuJoCo looks at the bits of bodies before those of their shapes.
    model.geom_conaffinity[model.geom(OBJECT).id] = model.body_conaffinity[model.body(OBJECT).id] = hits


def set_physics(model: mujoco.MjModel, scene: Scene, physics: Physics) -> None:
    """Set time step, solver, gravity, masses and surfaces: all of them, so that nothing of an earlier trial stays."""
    model.opt.timestep = 1 / physics.hz
    model.opt.iterations = physics.solver_iterations
    model.opt.gravity[:] = (0.0, 0.0, -physics.gravity_mps2)
    body, geom, thing = model.body(OBJECT).id, model.geom(OBJECT).id, scene.object
    model.body_mass[body], model.body_inertia[body] = thing.inertia.mass_kg, thing.inertia.diagonal
    # Frictions are multiplied, as in Bullet. Only the object and bodies that move resist rolling and spinning.
    model.geom_friction[:] = (physics.surface_friction**2, 0.0, 0.0)
    rolling = thing.rolling_friction_m
    model.geom_friction[geom] = (
        thing.friction * physics.surface_friction,
        *[rolling * physics.surface_friction] * 2,
    )
    # Contacts that resist rolling have rows for it.
    model.geom_condim[geom] = ROLLING_ROWS if rolling else SLIDING_ROWS
    model.geom_margin[geom] = _REACH_M
    # Friction stops sliding within one step if it can. `aim_contacts` replaces the targets along the normals.
    model.geom_solref[:] = (2 / physics.hz, 1.0)
    model.geom_solimp[:, :2] = HARDNESS
    # A pair of shapes that is named in the model has numbers of its own.
    model.pair_solref[:], model.pair_solimp[:, :2] = (2 / physics.hz, 1.0), HARDNESS
    surfaces = dict.fromkeys(range(model.ngeom), (physics.surface_friction, 0.0)) | {geom: (thing.friction, rolling)}
    for each in scene.bodies:
        surfaces |= dict.fromkeys(_list_geoms(model, each), (each.friction, each.rolling_friction_m))
    for pair, (one, other) in enumerate(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)):
        (friction, rolls), (other_friction, other_rolls) = surfaces[one], surfaces[other]
        resists = rolls * other_friction + other_rolls * friction
        model.pair_friction[pair] = (*[friction * other_friction] * 2, *[resists] * 3)
        model.pair_dim[pair] = ROLLING_ROWS if rolls or other_rolls else SLIDING_ROWS
    if scene.tool.seat is not None:
        weigh_held(model, is_held=True)
    # Recompute the numbers that the solver derives from masses, such as those by which it scales contacts.
    mujoco.mj_setConst(model, mujoco.MjData(model))


def count_shapes(model: mujoco.MjModel, scene: Scene) -> dict[str, int]:
    """Count the collision shapes of each link of the robot."""
    names = {link.name: _STAND_IN if link.name == _WORLD_LINK else link.name for link in scene.robot.links}
    return {link: int(model.body(name).geomnum[0]) for link, name in names.items()}


def _list_geoms(model: mujoco.MjModel, body: SceneBody) -> list[int]:
    return [model.geom(f"{_name_body(body)}/{number}").id for number in range(len(body.link.shapes))]


def find_bounces(model: mujoco.MjModel, scene: Scene) -> NDArray[np.float64]:
    """Find the restitution of each shape, by number; a contact has the product."""
    found = np.ones(model.ngeom)
    found[model.geom(OBJECT).id] = scene.object.restitution
    for each in scene.bodies:
        found[_list_geoms(model, each)] = each.restitution
    return found
