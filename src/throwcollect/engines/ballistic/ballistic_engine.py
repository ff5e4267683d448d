"""One world without contacts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from throwcollect.engines.ballistic.tool_path import ToolPath
from throwcollect.engines.body import Vector
from throwcollect.engines.engine import (
    GROUND,
    UPRIGHT,
    BodyState,
    Engine,
    Observer,
    Physics,
    Sample,
    Scene,
    State,
    Steps,
    make_rest,
    object_in,
)
from throwcollect.errors import ConfigError, Problem
from throwcollect.reproducible_math import matmul

_FREE: frozenset[str] = frozenset()
_ON_GROUND = frozenset({GROUND})

_Moment = tuple[Vector, Vector, frozenset[str]]
"""Position and velocity of the object after a step, and the names of the bodies that touch it."""


class BallisticEngine(Engine):
    """A world of kinematics: fast and simple, and not realistic.

    - At the end of each step, the arm is at the commanded positions, at the velocity that led there. Motors have no
      torques and no limits.
    - The object moves with its seat in the tool as long as the tool pushes it. From the first step on in which the tool
      would have to pull the ball back along its opening, or that lets go of it, it is free and keeps its velocity.
    - In each step, gravity and drag accelerate a free object, which then moves at its new velocity, as in Bullet. It
      touches nothing but solid ground, where it stays.
    - The object never spins, and nothing touches the robot.
    """

    def __init__(self) -> None:
        self._touching = self._reported = _FREE
        self._orientation = (0.0, 0.0, 0.0, 1.0)
        self._seat = np.zeros((3, 1))

    def load(self, scene: Scene) -> None:
        """Make the world of a scene."""
        if scene.bodies:
            names = ", ".join(body.link.name for body in scene.bodies)
            raise ConfigError(
                [Problem(f"should be left out, as the engine ballistic knows no contacts: {names}", "scene.bodies")],
                hint="--set sim.engine=mujoco simulates contacts",
            )
        if scene.object.link.shapes[0].kind != "sphere":
            raise ConfigError(
                [Problem("should be left out, as the engine ballistic throws balls only", "object")],
                hint="--set sim.engine=mujoco simulates contacts",
            )
        self._tool_path = ToolPath(scene)
        self._opening = np.array(scene.tool.opening).reshape(3, 1)
        self._carried_by = frozenset({scene.tool.name})
        self._scene = scene

    def configure(self, physics: Physics) -> None:
        """Set the numbers of the physics; this engine uses rate and gravity."""
        self._physics = physics

    def rest(self, joints: Sequence[float], seat: Vector | None) -> None:
        """Put joints and object at their start, all at rest."""
        place = None
        if seat is not None:
            origin, turn = self._tool_path.along(np.array([joints]))
            x, y, z = (origin + matmul(turn, np.array(seat).reshape(3, 1))).ravel().tolist()
            place = (x, y, z), UPRIGHT
        self.reset(replace(make_rest(self._scene, joints, place), touching=_FREE if seat is None else self._carried_by))

    def reset(self, state: State) -> None:
        """Put robot and object into a state; the place of an object that touches the tool becomes its seat."""
        count = len(self._scene.moving)
        self._joints, self._velocities = np.array(state.sample[: 2 * count]).reshape(2, count)
        self.place(0, object_in(state.sample))
        self._touching = self._reported = state.touching
        place, turn = self._tool_path.along(self._joints[np.newaxis])
        away = np.array(self._position).reshape(3, 1) - place[0]
        self._seat = matmul(turn[0].T, away)

    @property
    def state(self) -> State:
        """Robot and object now."""
        return State(self._sample(), self._touching)

    def run(self, steps: Steps, observer: Observer) -> int:
        """Take steps until the observer stops them."""
        number, due = 0, steps.first_sample
        for number, (position, velocity, touching) in enumerate(self._compute_path(steps), start=1):
            self._joints, self._velocities = steps.targets[number], steps.velocities[number - 1]
            self._position, self._velocity, self._touching = position, velocity, touching
            # Every engine tells observers only of changes.
            if touching != self._reported:
                self._reported = touching
                observer.on_touch(number, touching)
            if number == due:
                due += steps.stride
                if observer.on_sample(number, self._sample()):
                    break
        return number

    def place(self, number: int, state: BodyState) -> None:  # noqa: ARG002 - nothing else moves
        """Set pose and velocity of the object, which is free then; it does not spin."""
        self._position, self._velocity = state.position, state.linear_velocity
        self._orientation = state.orientation_xyzw
        self._touching = _FREE

    def _sample(self) -> Sample:
        torques = (0.0,) * len(self._joints)
        moved = (*self._position, *self._orientation, *self._velocity, 0.0, 0.0, 0.0)
        return (*self._joints.tolist(), *self._velocities.tolist(), *torques, *moved)

    def _compute_path(self, steps: Steps) -> Iterator[_Moment]:
        """Compute the object after each step."""
        moment = self._position, self._velocity, self._touching
        steps_left = len(steps.velocities)
        if self._touching == self._carried_by:
            for moment in self._carry(steps):
                steps_left -= 1
                yield moment
        for _ in range(steps_left):
            if moment[2] != _ON_GROUND:
                moment = self._fly(moment[0], moment[1], steps)
            yield moment

    def _carry(self, steps: Steps) -> Iterator[_Moment]:
        """Compute the object in its seat, up to the step in which the tool would have to pull it, or lets go of it."""
        place, turn = self._tool_path.along(steps.targets[1:])
        hz = self._physics.hz
        # Joints follow their commands without delay, so the path of the seat is known for all steps at once.
        path = np.vstack((self._position, (place + matmul(turn, self._seat))[:, :, 0]))
        velocities = np.vstack((self._velocity, np.diff(path, axis=0) * hz))
        push = np.diff(velocities, axis=0) * hz
        # The tool has to give the object the acceleration of its path, less that of gravity.
        push[:, 2] += self._physics.gravity_mps2
        # The components are added here and not by a matrix product, whose rounding depends on the processor.
        x, y, z = (push * matmul(turn, self._opening)[:, :, 0]).T
        pulled = np.flatnonzero(x + y + z <= 0)
        last = int(pulled[0]) if len(pulled) else len(push)
        if self._scene.tool.seat is not None:
            last = min(steps.held, len(push))
        for position, velocity in zip(path[1 : last + 1].tolist(), velocities[1 : last + 1].tolist(), strict=True):
            yield tuple(position), tuple(velocity), self._carried_by

    def _fly(self, position: Vector, velocity: Vector, steps: Steps) -> _Moment:
        """Compute the object one step of free flight later, or on the ground if that stops it."""
        dt = 1 / self._physics.hz
        (x, y, z), (vx, vy, vz) = position, velocity
        braking = steps.drag_kgpm / self._scene.object.inertia.mass_kg * math.sqrt(vx * vx + vy * vy + vz * vz)
        # Bullet takes these operations in this order, and so does `tasks.free_flight`, with which flights are compared.
        vx -= braking * vx * dt
        vy -= braking * vy * dt
        vz -= (self._physics.gravity_mps2 + braking * vz) * dt
        x, y, z = x + vx * dt, y + vy * dt, z + vz * dt
        radius = self._scene.object.link.shapes[0].size[0]
        if (self._scene.ground_is_solid or steps.ground_is_solid) and z < radius:
            return (x, y, radius), (0.0, 0.0, 0.0), _ON_GROUND
        return (x, y, z), (vx, vy, vz), _FREE
