"""One Bullet world."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import pybullet

from throwcollect.engines.body import Vector
from throwcollect.engines.bullet.scenery import (
    BASE,
    Surface,
    World,
    describe,
    find_origin,
    load_bodies,
    load_object,
    load_scenery,
    place_body,
    renew_moving,
    renew_pairs,
    set_physics,
)
from throwcollect.engines.engine import (
    UPRIGHT,
    BodyState,
    Engine,
    LoadedRobot,
    Observer,
    Physics,
    Sample,
    Scene,
    SceneBody,
    State,
    Steps,
    body_of,
    make_rest,
    object_in,
    split_bodies,
)
from throwcollect.engines.grip import carry, find_held

_ANY_BODY, _ANY_LINK = -1, -2


class BulletEngine(Engine):
    """A Bullet world in this process.

    Raises:
        WorkerError: If Bullet refuses to start another world in this process.
    """

    _scene: Scene

    def __init__(self) -> None:
        self._world = World()
        self._bodies: dict[int, SceneBody] = {}
        self._object_id, self._is_loaded = BASE, False
        self._touching: frozenset[str] = frozenset()
        # The surfaces that pressed on the object in the last step; None if there was no step since the last reset.
        self._pressing: set[Surface] | None = None

    def close(self) -> None:
        """Free the world; it cannot be used afterwards."""
        self._world.disconnect()

    def load(self, scene: Scene) -> None:
        """Make the world of a scene; if nothing but the object and the bodies differs, only these are made anew."""
        if self._is_loaded and scene == self._scene:
            return
        # If loading fails, the next call must not keep anything of this world.
        keeps, self._is_loaded = self._is_loaded and scene.has_robot_of(self._scene), False
        if not keeps:
            self._scenery, self._bodies = load_scenery(self._world, scene), {}
        else:
            # All of them, so that they follow each other in the same order as in a new world.
            for body in (*self._bodies, self._object_id):
                self._world.removeBody(body)
        self._bodies = load_bodies(self._world, scene.bodies)
        self._names = self._scenery.names | {(each, BASE): body.link.name for each, body in self._bodies.items()}
        self._object_id = load_object(self._world, scene.object)
        self._moving = [number for number, body in self._bodies.items() if body.moves]
        self._displaced = {each for each in self._moving if not self._bodies[each].inertia.is_centred}
        self._tool, self._object, self._scene, self._is_loaded = scene.tool, scene.object, scene, True

    def describe_robot(self, positions: Sequence[float]) -> LoadedRobot:
        """Describe the robot as Bullet has it."""
        return describe(self._world, self._scenery, positions)

    def configure(self, physics: Physics) -> None:
        """Set all numbers of the physics."""
        # Bullet computes the inertia of the object from its shape.
        self._world.changeDynamics(self._object_id, BASE, mass=self._object.inertia.mass_kg)
        set_physics(self._world, self._scenery, {self._object_id: self._object, **self._bodies}, physics)
        self._physics, self._forces = physics, list(physics.efforts)
        # Bullet divides the error of a position by the time step before it multiplies it by the gain.
        self._position_gains = [physics.position_gain_per_s / physics.hz] * len(physics.efforts)
        self._velocity_gains = [physics.velocity_gain] * len(physics.efforts)

    def rest(self, joints: Sequence[float], seat: Vector | None) -> None:
        """Put joints, object and bodies at their start, all at rest."""
        scenery = self._scenery
        for joint, angle in zip(scenery.joints, joints, strict=True):
            self._world.resetJointState(scenery.robot, joint, angle)
        place = None
        if seat is not None:
            tool = self._world.getLinkState(scenery.robot, scenery.tool, computeForwardKinematics=True)
            # Fields 4 and 5 are the pose of the link's frame. Those before are of its centre of mass.
            place = self._world.multiplyTransforms(tool[4], tool[5], seat, UPRIGHT)[0], tool[5]
        self.reset(make_rest(self._scene, joints, place))

    def reset(self, state: State) -> None:
        """Put robot, bodies and object into a state, and leave no trace of earlier ones in the world.

        Bullet's own snapshots do not achieve that: they keep pairs of shapes that once came close, and with them the
        order in which contacts are solved. `renew_pairs` forgets those.
        """
        joints = self._scenery.joints
        positions, velocities = state.sample[: len(joints)], state.sample[len(joints) :]
        # Torques and bodies follow the velocities in a sample, and `zip` stops before them.
        for joint, position, velocity in zip(joints, positions, velocities, strict=False):
            self._world.resetJointState(self._scenery.robot, joint, position, velocity)
        renew_pairs(self._world, self._object_id)
        self._has_floor = False
        place_body(self._world, self._object_id, self._object, object_in(state.sample))
        for number, numbers in zip(self._moving, split_bodies(state.sample, len(joints)), strict=True):
            renew_moving(self._world, number)
            place_body(self._world, number, self._bodies[number], body_of(numbers))
        self._touching, self._pressing = state.touching, None
        self._hold(find_held(self._tool, state))

    @property
    def state(self) -> State:
        """Robot, bodies and object now; right after `reset` without torques, as Bullet has none before a step."""
        if self._pressing is None:
            return State(self._sample(), self._touching)
        return State(self._sample(), self._name(self._pressing))

    def run(self, steps: Steps, observer: Observer) -> int:
        """Take steps until the observer stops them."""
        if steps.ground_is_solid != self._has_floor:
            self._has_floor = steps.ground_is_solid
            renew_pairs(self._world, self._object_id, floor=self._has_floor)
        # Local names, arguments by position and a single loop, because every operation here costs time in every step.
        object_id, robot, joints = self._object_id, self._scenery.robot, self._scenery.joints
        forces, position_gains, velocity_gains = self._forces, self._position_gains, self._velocity_gains
        aim, mode = self._world.setJointMotorControlArray, pybullet.POSITION_CONTROL
        take_step, points_on = self._world.stepSimulation, self._world.getContactPoints
        drag, due, stride = steps.drag_kgpm, steps.first_sample, steps.stride
        last_pressing, nothing = self._pressing, set[Surface]()
        number, last_wanted = 0, None
        # Bullet reads lists twice as fast as arrays.
        for wanted in zip(steps.targets[:-1].tolist(), steps.velocities.tolist(), strict=True):
            # A motor gets the position of the beginning of the step and the velocity that leads from there to the
            # target, so that it follows without lag. It keeps both, so while the arm stands still nothing is sent.
            if wanted != last_wanted:
                last_wanted = wanted
                position, velocity = wanted
                aim(robot, joints, mode, position, velocity, forces, position_gains, velocity_gains)
            if number == steps.held:
                self._hold(None)
            if drag:
                # Drag is applied before every step, because Bullet forgets external forces after each.
                self._apply_drag(drag)
            take_step()
            number += 1
            # Bullet also lists points that are close without touching; those have no normal force (field 9).
            points = points_on(object_id, _ANY_BODY, _ANY_LINK, _ANY_LINK)
            pressing = {(point[2], point[4]) for point in points if point[9] > 0} if points else nothing
            if self._held is not None:
                self._carry(self._held)
                pressing = {*pressing, (robot, self._scenery.tool)}
            if pressing != last_pressing:
                self._pressing = last_pressing = pressing
                self._report_touch(number, observer)
            if number == due:
                due += stride
                if observer.on_sample(number, self._sample()):
                    break
        return number

    def place(self, number: int, state: BodyState) -> None:
        """Set pose and velocity of a body."""
        if not number:
            self._hold(None)
        body = ((self._object_id, self._object), *((each, self._bodies[each]) for each in self._moving))[number]
        place_body(self._world, *body, state)

    def _hold(self, held: BodyState | None) -> None:
        """Let the tool hold the object, whose mass the arm bears, or none."""
        self._held = held
        if self._scenery.held is not None:
            inertia, share = self._object.inertia, 1.0 if held else 0.0
            load = {
                "mass": share * inertia.mass_kg,
                "localInertiaDiagonal": [share * moment for moment in inertia.diagonal],
            }
            self._world.changeDynamics(self._scenery.robot, self._scenery.held, **load)

    def _carry(self, held: BodyState) -> None:
        """Move the held object to where the tool is after a step."""
        robot, link = self._scenery.robot, self._scenery.held
        place = self._world.getLinkState(robot, link, computeForwardKinematics=True)
        self._held = carry(held, place[4], place[5], self._physics.hz)
        place_body(self._world, self._object_id, self._object, self._held)

    def _report_touch(self, step: int, observer: Observer) -> None:
        """Tell the observer which bodies press on the object now, unless only other surfaces of the same bodies do."""
        touching = self._name(self._pressing or ())
        if touching != self._touching:
            self._touching = touching
            observer.on_touch(step, touching)

    def _name(self, surfaces: Iterable[Surface]) -> frozenset[str]:
        return frozenset(self._names[surface] for surface in surfaces)

    def _sample(self) -> Sample:
        world = self._world
        joints = world.getJointStates(self._scenery.robot, self._scenery.joints)
        # Each joint has four values here, so nothing has to be strict. Adding tuples is the fastest way to join them.
        positions, velocities, _, torques = zip(*joints)  # noqa: B905
        sample: Sample = positions + velocities + torques
        for body in (*self._moving, self._object_id):
            place, turn = world.getBasePositionAndOrientation(body)
            linear, angular = world.getBaseVelocity(body)
            numbers = place + turn + linear + angular
            sample += find_origin(world, body, numbers) if body in self._displaced else numbers
        return sample

    def _apply_drag(self, drag_kgpm: float) -> None:
        position, _ = self._world.getBasePositionAndOrientation(self._object_id)
        velocity, _ = self._world.getBaseVelocity(self._object_id)
        factor = -drag_kgpm * math.hypot(*velocity)
        force = [factor * component for component in velocity]
        self._world.applyExternalForce(self._object_id, BASE, force, position, pybullet.WORLD_FRAME)
