"""One MuJoCo world."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress

import mujoco
import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.engine import (
    BODY_NUMBERS,
    BodyState,
    Engine,
    LoadedRobot,
    Observer,
    Physics,
    Quaternion,
    Sample,
    Scene,
    State,
    Steps,
    body_of,
    make_rest,
    object_in,
    split_bodies,
)
from throwcollect.engines.grip import HELD_LINK, carry, find_held
from throwcollect.engines.mujoco.loop import check_version, make_loop
from throwcollect.engines.mujoco.scenery import (
    OBJECT,
    count_shapes,
    find_bounces,
    find_reach,
    let_object_hit_floor,
    make_spec,
    place_bodies,
    resize_object,
    set_physics,
    weigh_held,
)
from throwcollect.engines.mujoco.stepping import EMPTY, turn, write_sample
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import matmul

# A world that diverges has samples that are not finite, which are refused. By default, MuJoCo would also write a file
# MUJOCO_LOG.TXT into the current directory.
if mujoco.get_mju_user_warning() is None:
    mujoco.set_mju_user_warning(lambda _: None)

_LOOP = make_loop()
"""Made when this module is imported: by the process from which simulations are forked, before they are."""

_AHEAD = 64
"""Steps that are taken before the observer gets their samples; if it stops at one, the world goes back to that one."""


class MujocoEngine(Engine):
    """A MuJoCo world in this process.

    Raises:
        ConfigError: If the MuJoCo that is installed is another one than the one that this needs.
    """

    _scene: Scene
    _model: mujoco.MjModel

    def __init__(self) -> None:
        check_version()
        self._is_loaded = False
        self._touching: frozenset[str] = frozenset()

    @classmethod
    def describe_steps(cls) -> str:
        """See `Engine.describe_steps`."""
        check_version()
        return _LOOP.made

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
        self._grip = [name == scene.tool.name for name in self._surfaces]
        # Joints of the robot come first in the model, but not in the order of the scene.
        names = [self._model.joint(number).name for number in range(len(scene.moving))]
        self._columns = np.array([scene.moving.index(name) for name in names])
        self._order = [names.index(name) for name in scene.moving]
        self._share_memory()
        self._is_loaded = True

    def _share_memory(self) -> None:
        """Make the arguments of the loop that stay as long as the world does."""
        model, data, count, surfaces = self._model, self._data, len(self._order), len(self._surfaces)
        bodies = 1 + len(self._scene.moving_bodies)
        self._motors, self._bounces = np.zeros((count, 4)), np.zeros(model.ngeom)
        self._pressing = np.zeros(surfaces, int)
        self._samples = np.zeros((_AHEAD, 3 * count + BODY_NUMBERS * bodies))
        self._states = np.zeros((_AHEAD, model.nq + 4 * model.nv))
        self._changes = np.zeros(1 + (_AHEAD + 1) * (1 + surfaces), int)
        memory = [data.qpos, data.qvel, data.qacc, data.qacc_warmstart, data.qfrc_passive, data.qfrc_constraint]
        memory += [data.qfrc_applied, data.qfrc_inverse, data.sensordata, data.xipos, data.ximat]
        memory += [model.bvh_aabb, model.body_bvhadr, self._motors, self._bounces, np.array(self._order)]
        # Arrays have to live as long as what is shared of them.
        self._memory = [
            array.reshape(-1) for array in (*memory, self._samples, self._states, self._changes, self._pressing)
        ]
        # To find out in Python what is far takes longer than to look for contacts, and bodies may be touched anywhere.
        watched = 0 if self._scene.bodies or not _LOOP.is_compiled else model.body(OBJECT).id
        self._sizes = count, bodies
        sizes = (*self._sizes, surfaces, watched)
        self._fixed = [*_LOOP.list_world(model, data), *map(_LOOP.share, self._memory), *sizes]

    def describe_robot(self, positions: Sequence[float]) -> LoadedRobot:
        """Describe the robot as MuJoCo has it."""
        model, count = self._model, len(self._order)
        data, matrix = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        data.qpos[:count] = np.array(positions)[self._columns]
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, matrix)
        x, y, z = data.body(self._scene.tool.link).xpos.tolist()
        return LoadedRobot(count_shapes(model, self._scene), matrix[np.ix_(self._order, self._order)], (x, y, z))

    def configure(self, physics: Physics) -> None:
        """Set all numbers of the physics."""
        self._physics, model, motors, hz = physics, self._model, self._motors, float(physics.hz)
        set_physics(model, self._scene, physics)
        self._bounces[:], self._reach_m = find_bounces(model, self._scene), find_reach(model)
        motors[:, 0], motors[:, 1] = hz * physics.position_gain_per_s, hz * physics.velocity_gain
        motors[:, 2], motors[:, 3] = model.dof_damping[: len(motors)] / hz, np.array(physics.efforts)[self._columns]

    def rest(self, joints: Sequence[float], seat: Vector | None) -> None:
        """Put joints, object and bodies at their start, all at rest."""
        model, data = self._model, self._data
        place = None
        if seat is not None:
            data.qpos[: len(joints)] = np.array(joints)[self._columns]
            mujoco.mj_kinematics(model, data)
            tool = data.body(self._scene.tool.link)
            centre = (tool.xpos + matmul(tool.xmat.reshape(3, 3), np.array(seat).reshape(3, 1)).ravel()).tolist()
            place = centre, _to_xyzw(tool.xquat)
        self.reset(make_rest(self._scene, joints, place))

    def reset(self, state: State) -> None:
        """Put robot, bodies and object into a state, and leave no trace of earlier ones in the world."""
        count, data = len(self._columns), self._data
        let_object_hit_floor(self._model, floor=False)
        self._model.opt.disableflags &= ~EMPTY
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
        """Take steps until the observer stops them."""
        let_object_hit_floor(self._model, floor=steps.ground_is_solid)
        targets, velocities = steps.targets[:-1, self._columns], steps.velocities[:, self._columns]
        # These are in the order of steps, whatever NumPy makes of the columns above.
        wanted = np.ravel(self._motors[:, 0] * targets + self._motors[:, 1] * velocities)
        total = len(targets)
        shared, hz, stride = _LOOP.share(wanted), float(self._physics.hz), steps.stride
        due, number, width = steps.first_sample, 0, 1 + len(self._surfaces)
        # This equals no state of the surfaces, so the first step is compared with what pressed before.
        self._pressing.fill(-1)
        is_over = False
        while number < total and not is_over:
            if number == steps.held:
                self._hold(None)
            last = min(number + (1 if self._held else _AHEAD), total)
            call = (shared, number, last, due, stride, hz, steps.drag_kgpm, self._reach_m, steps.plane_m)
            last = _LOOP.take_steps(*self._fixed, *call)
            samples, done = self._samples[: max(0, 1 + (last - due) // stride)], 0
            changes = self._changes[1 : 1 + self._changes[0] * width].reshape(-1, width).tolist()
            if self._held is not None:
                self._carry(self._held)
                changes, samples[:] = [[last, *self._pressing.tolist()]], self._sample()
            for step, *presses in (*changes, [last + 1]):
                # The samples before something else presses on the object.
                before = max(done, -((due - step) // stride))
                if before > done:
                    sampled = range(due + done * stride, due + before * stride, stride)
                    end = observer.on_samples(sampled, samples[done:before])
                    if is_over := end is not None:
                        if sampled[end] < last:
                            self._go_back(done + end)
                        last = sampled[end]
                        break
                    done = before
                if presses:
                    self._report_touch(step, presses, observer)
            due += done * stride
            number = last
        # Forces that are applied stay until they are replaced, and the next steps may have no drag.
        self._data.qfrc_applied[len(self._order) : len(self._order) + 3] = 0.0
        return number

    def _go_back(self, place: int) -> None:
        """Put the world back to where it was at a sample of the last steps."""
        data, state = self._data, self._states[place]
        data.qpos[:], rest = state[: len(data.qpos)], state[len(data.qpos) :].reshape(4, -1)
        data.qvel[:], data.qacc_warmstart[:], data.qfrc_constraint[:], data.qfrc_applied[:] = rest

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

    def _carry(self, held: BodyState) -> None:
        """Move the held object to where the tool is after a step, and let the tool press on it."""
        mujoco.mj_kinematics(self._model, self._data)
        (x, y, z), turned = self._data.xpos[self._seat].tolist(), _to_xyzw(self._data.xquat[self._seat])
        self._held = carry(held, (x, y, z), turned, self._physics.hz)
        self._place(0, self._held)
        self._pressing[self._grip] = 1

    def _compute_contact_forces(self) -> None:
        """Compute the contact forces on the robot that motors need in the first step, as if they had held it before."""
        model, data, count = self._model, self._data, len(self._columns)
        mujoco.mj_step1(model, data)
        data.qfrc_applied[:count] = data.qfrc_bias[:count]
        _LOOP.take_steps(*self._fixed, self._fixed[8], 0, 0, 0, 0, float(self._physics.hz), 0.0, 0.0, 0.0)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)

    def _report_touch(self, step: int, presses: Sequence[int], observer: Observer) -> None:
        """Tell the observer which bodies press on the object now, if others did before; one number says so of each."""
        touching = frozenset(compress(self._surfaces, presses))
        if touching != self._touching:
            self._touching = touching
            observer.on_touch(step, touching)

    def _sample(self) -> Sample:
        numbers = [0.0] * self._samples.shape[1]
        qpos, qvel, applied = (part.tolist() for part in (self._data.qpos, self._data.qvel, self._data.qfrc_applied))
        write_sample(qpos, qvel, applied, self._order, *self._sizes, numbers, 0)
        return tuple(numbers)


def _list_kinds(scene: Scene) -> list[object]:
    """List what a compiled model cannot change of object and bodies: names and kinds of plain ones, all of others."""
    return [
        (body.link.name, body.moves, [shape.kind for shape in body.link.shapes]) if body.link.is_plain else body.link
        for body in (scene.object, *scene.bodies)
    ]


def _to_xyzw(orientation_wxyz: NDArray[np.float64]) -> Quaternion:
    w, x, y, z = orientation_wxyz.tolist()
    return x, y, z, w


def _turn_back(orientation_xyzw: Quaternion, vector: Vector) -> Vector:
    """Turn a vector from world into the frame of a body."""
    x, y, z, w = orientation_xyzw
    return turn(-x, -y, -z, w, *vector)
