"""One MuJoCo world."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import compress
from operator import itemgetter, or_

import mujoco
import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.engine import (
    BODY_NUMBERS,
    BodyState,
    Engine,
    LoadedLink,
    Observer,
    Physics,
    Quaternion,
    Sample,
    Scene,
    State,
    Steps,
    body_of,
    object_in,
    split_bodies,
)
from throwcollect.engines.grip import HELD_LINK, carry, find_held
from throwcollect.engines.mujoco.contact_targets import ROLLING_ROWS, SLIDING_ROWS, aim_contacts
from throwcollect.engines.mujoco.scenery import (
    Surface,
    describe_links,
    find_bounces,
    let_object_hit_floor,
    make_spec,
    place_bodies,
    resize_object,
    set_physics,
    weigh_held,
)
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import matmul

_ORIENTATION, _SPIN = slice(-10, -6), -3
"""Places of the object's orientation and angular velocity in a sample."""

_PRESS = 3
"""Each contact sensor has three numbers, of which the first is the normal force."""


class MujocoEngine(Engine):
    """A MuJoCo world in this process."""

    _scene: Scene
    _physics: Physics
    _surfaces: list[Surface]
    _bounces: dict[int, float]
    _rows: int
    _seat: int | None
    _held: BodyState | None
    _model: mujoco.MjModel
    _data: mujoco.MjData

    def __init__(self) -> None:
        self._is_loaded = False
        self._touching: frozenset[str] = frozenset()

    def close(self) -> None:
        """Free the world."""
        if self._is_loaded:
            self._is_loaded = False
            del self._model, self._data

    def load(self, scene: Scene) -> None:
        """Make the world of a scene; if nothing but numbers of the object and the bodies differs, only these change."""
        if self._is_loaded and scene.has_robot_of(self._scene) and _list_kinds(scene) == _list_kinds(self._scene):
            resize_object(self._model, scene.object)
            place_bodies(self._model, scene.bodies)
            self._scene = scene
            return
        self._scene, self._is_loaded = scene, False
        try:
            spec, self._surfaces = make_spec(scene)
            self._model = spec.compile()
        except ValueError as error:
            raise ConfigError(f"MuJoCo cannot load the robot's description: {error}") from error
        place_bodies(self._model, scene.bodies)
        self._data = mujoco.MjData(self._model)
        self._seat = None if scene.tool.seat is None else self._model.body(HELD_LINK).id
        self._grip = bytes(surface.name == scene.tool.name for surface in self._surfaces)
        # Joints of the robot come first in the model, but not in the order of the scene.
        names = [self._model.joint(number).name for number in range(len(scene.moving))]
        self._columns = np.array([scene.moving.index(name) for name in names])
        self._places = [names.index(name) for name in scene.moving]
        self._is_loaded = True

    def describe_robot(self) -> list[LoadedLink]:
        """Describe the robot's links as MuJoCo has them."""
        return describe_links(self._model, self._scene.robot)

    def configure(self, physics: Physics) -> None:
        """Set all numbers of the physics."""
        self._physics = physics
        set_physics(self._model, self._scene, physics)
        self._rows = ROLLING_ROWS if self._scene.object.rolling_friction_m else SLIDING_ROWS
        self._bounces = find_bounces(self._model, self._scene)
        moving, first = len(self._scene.moving_bodies), 3 * len(self._places)
        self._pick = _make_sample_picker(self._model, self._places, moving)
        self._ends_of_bodies = [first + BODY_NUMBERS * number for number in range(1, moving + 1)]

    def rest(self, joints: Sequence[float], seat: Vector | None) -> None:
        """Put joints, object and bodies at their start, all at rest."""
        model, data = self._model, self._data
        placed, touching = self._scene.object.start, frozenset[str]()
        if seat is not None:
            data.qpos[: len(joints)] = np.array(joints)[self._columns]
            mujoco.mj_kinematics(model, data)
            tool = data.body(self._scene.tool.link)
            centre = (tool.xpos + matmul(tool.xmat.reshape(3, 3), np.array(seat).reshape(3, 1)).ravel()).tolist()
            turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
            if self._scene.tool.seat is not None:
                turn, touching = _to_xyzw(tool.xquat), frozenset({self._scene.tool.name})
            placed = (*centre, *turn, *(0.0,) * 6)
        still = (0.0,) * len(joints)
        bodies = [part for body in self._scene.moving_bodies for part in body.start]
        self.reset(State((*joints, *still, *still, *bodies, *placed), touching))

    def reset(self, state: State) -> None:
        """Put robot, bodies and object into a state, and leave no trace of earlier ones in the world."""
        count, data = len(self._columns), self._data
        let_object_hit_floor(self._model, floor=False)
        mujoco.mj_resetData(self._model, data)
        positions, velocities = np.array(state.sample[: 2 * count]).reshape(2, count)
        data.qpos[:count], data.qvel[:count] = positions[self._columns], velocities[self._columns]
        self.place(0, object_in(state.sample))
        for number, numbers in enumerate(split_bodies(state.sample, count), start=1):
            self._place(number, body_of(numbers))
        self._touching = state.touching
        self._hold(find_held(self._scene.tool, state))
        self._compute_contact_forces()

    @property
    def state(self) -> State:
        """Robot, bodies and object now; right after `reset` without torques, as there are none before a step."""
        return State(self._sample(), self._touching)

    def run(self, steps: Steps, observer: Observer) -> int:
        """Take steps until the observer stops them.

        In one step, a motor gives its joint the velocity that Bullet's motor would give it. Inverse dynamics of the
        present state give the torque for that, with the contact forces of the step before and within the efforts. So
        the solver finds contacts for the motion that the tool really has.
        """
        let_object_hit_floor(self._model, floor=steps.ground_is_solid)
        # Local names, arithmetic in place and a single loop, because every operation here costs time in every step.
        model, data, physics = self._model, self._data, self._physics
        count, hz = len(self._columns), float(physics.hz)
        pull, brake = (np.full(count, hz * gain) for gain in (physics.position_gain_per_s, physics.velocity_gain))
        # These are views: what is written into `acceleration` and `torque` is what MuJoCo computes with.
        position, velocity = data.qpos[:count], data.qvel[:count]
        acceleration, torque = data.qacc[:count], data.qfrc_applied[:count]
        passive, pushed = data.qfrc_passive[:count], data.qfrc_constraint[:count]
        needed, work, other = np.zeros(model.nv), np.zeros(count), np.zeros(count)
        load = needed[:count]
        most = np.array(physics.efforts)[self._columns]
        least, lag = -most, model.dof_damping[:count] / hz
        pressing, nothing = data.sensordata[::_PRESS], np.zeros(len(self._surfaces))
        presses, untouched = np.zeros(len(self._surfaces), np.bool_), bytes(len(self._surfaces))
        multiply, add, subtract, maximum, minimum = np.multiply, np.add, np.subtract, np.maximum, np.minimum
        begin_step, end_step, inverse, greater = mujoco.mj_step1, mujoco.mj_step2, mujoco.mj_rne, np.greater
        drag, due, stride = steps.drag_kgpm, steps.first_sample, steps.stride
        restitution, bounces, rows = self._scene.object.restitution, self._bounces, self._rows
        # This equals no state of the surfaces, so the first step compares what presses with what pressed before.
        last_presses, number = b"", 0
        for want in list(pull * steps.targets[:-1, self._columns] + brake * steps.velocities[:, self._columns]):
            if number == steps.held:
                self._hold(None)
            begin_step(model, data)
            # Bullet's motor accelerates by hz (gain (target - position) + share (target velocity - velocity)).
            subtract(want, multiply(position, pull, work), work)
            subtract(work, multiply(velocity, brake, other), acceleration)
            inverse(model, data, 1, needed)
            # Joint damping acts on the velocity after the step.
            subtract(multiply(acceleration, lag, work), passive, work)
            subtract(work, pushed, work)
            add(work, load, work)
            maximum(minimum(work, most, out=work), least, out=torque)
            contacts = data.ncon
            if contacts:
                aim_contacts(data, hz, restitution, bounces, rows)
            if drag:
                self._apply_drag(drag)
            end_step(model, data)
            number += 1
            now = greater(pressing, nothing, presses).tobytes() if contacts else untouched
            if self._held is not None:
                now = self._carry(self._held, now)
            if now != last_presses:
                last_presses = now
                self._report_touch(number, now, observer)
            if number == due:
                due += stride
                if observer.on_sample(number, self._sample()):
                    break
        # Forces that are applied stay until they are replaced, and the next steps may have no drag.
        data.qfrc_applied[count : count + 3] = 0.0
        return number

    def place(self, number: int, state: BodyState) -> None:
        """Set pose and velocity of a body."""
        if not number:
            self._hold(None)
        self._place(number, state)

    def _place(self, number: int, body: BodyState) -> None:
        """Set pose and velocity of the object, number 0, or of a body of the scene that moves, by its number from 1."""
        at, by = len(self._columns) + 7 * number, len(self._columns) + 6 * number
        x, y, z, w = body.orientation_xyzw
        self._data.qpos[at : at + 7] = (*body.position, w, x, y, z)
        spin = _turn_back(body.orientation_xyzw, body.angular_velocity)
        self._data.qvel[by : by + 6] = (*body.linear_velocity, *spin)

    def _hold(self, held: BodyState | None) -> None:
        """Let the tool hold the object, whose mass the arm bears, or none."""
        self._held = held
        if self._seat is not None:
            weigh_held(self._model, is_held=held is not None)

    def _carry(self, held: BodyState, presses: bytes) -> bytes:
        """Move the held object to where the tool is after a step, and return which surfaces press on it."""
        mujoco.mj_kinematics(self._model, self._data)
        (x, y, z), turn = self._data.xpos[self._seat].tolist(), _to_xyzw(self._data.xquat[self._seat])
        self._held = carry(held, (x, y, z), turn, self._physics.hz)
        self._place(0, self._held)
        return bytes(map(or_, presses, self._grip))

    def _compute_contact_forces(self) -> None:
        """Compute the contact forces on the robot that motors need in the first step, as if they had held it before."""
        model, data, count = self._model, self._data, len(self._columns)
        mujoco.mj_step1(model, data)
        data.qfrc_applied[:count] = data.qfrc_bias[:count]
        if data.ncon:
            aim_contacts(data, self._physics.hz, self._scene.object.restitution, self._bounces, self._rows)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)

    def _report_touch(self, step: int, presses: bytes, observer: Observer) -> None:
        """Tell the observer which bodies press on the object now, if others did before.

        `presses` has one byte for each surface, 1 if it presses.
        """
        touching = frozenset(surface.name for surface in compress(self._surfaces, presses))
        if touching != self._touching:
            self._touching = touching
            observer.on_touch(step, touching)

    def _sample(self) -> Sample:
        data = self._data
        row = self._pick(data.qpos.tolist() + data.qvel.tolist() + data.qfrc_applied.tolist())
        for end in self._ends_of_bodies:
            row = row[: end + _SPIN] + _turn(row[end - 10 : end - 6], row[end + _SPIN : end]) + row[end:]
        return row[:_SPIN] + _turn(row[_ORIENTATION], row[_SPIN:])

    def _apply_drag(self, drag_kgpm: float) -> None:
        first = len(self._columns)
        velocity = self._data.qvel[first : first + 3].tolist()
        factor = -drag_kgpm * math.hypot(*velocity)
        self._data.qfrc_applied[first : first + 3] = [factor * component for component in velocity]


def _list_kinds(scene: Scene) -> list[object]:
    """List what a compiled model cannot change of object and bodies: names and kinds of plain ones, all of others."""
    return [
        (body.link.name, body.moves, [shape.kind for shape in body.link.shapes]) if body.link.is_plain else body.link
        for body in (scene.object, *scene.bodies)
    ]


def _make_sample_picker(model: mujoco.MjModel, order: Sequence[int], bodies: int) -> Callable[[list[float]], Sample]:
    """Make a function that picks a sample from all positions, velocities and forces.

    The function leaves angular velocities in the frames of their bodies. `order` is the place of each moving joint
    among the joints of the model, behind which are those of the object and of some moving bodies.
    """
    velocities, forces = model.nq, model.nq + model.nv
    places = [first + place for first in (0, velocities, forces) for place in order]
    for number in (*range(1, bodies + 1), 0):
        x, y, z, w, i, j, k = range(len(order) + 7 * number, len(order) + 7 * number + 7)
        first = velocities + len(order) + 6 * number
        places += [x, y, z, i, j, k, w, *range(first, first + 6)]
    pick: Callable[[list[float]], Sample] = itemgetter(*places)
    return pick


def _turn(orientation_xyzw: Sequence[float], vector: Sequence[float]) -> Vector:
    """Turn a vector from the frame of a body into world."""
    x, y, z, w = orientation_xyzw
    a, b, c = vector
    # With t = 2 u x v for the vector part u and the real part w, the turned vector is v + w t + u x t.
    p, q, r = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p)


def _to_xyzw(orientation_wxyz: NDArray[np.float64]) -> Quaternion:
    w, x, y, z = orientation_wxyz.tolist()
    return x, y, z, w


def _turn_back(orientation_xyzw: Quaternion, vector: Vector) -> Vector:
    """Turn a vector from world into the frame of a body."""
    x, y, z, w = orientation_xyzw
    return _turn((-x, -y, -z, w), vector)
