"""Bodies that are put into a world while it is there: the obstacles, tables and robots of clients."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pybullet

from throwcollect.errors import RequestError
from throwcollect.sim.bullet import BASE, Box, boxes, collide_with_everything, connect, links
from throwcollect.sim.contacts import Surface
from throwcollect.sim.mesh import write_stl
from throwcollect.sim.recording import BodyState, Quaternion, Vector
from throwcollect.sim.urdf import Model

_JOINT_TYPE, _LARGEST_EFFORT, _LINK_NAME = 2, 10, 12
_INERTIAL_POSITION, _INERTIAL_ORIENTATION = 3, 4


@dataclass
class _Spawned:
    """A body.

    Attributes:
        model: What it is.
        start: State in which it was spawned.
        body: Its body number; None while it is not loaded.
    """

    model: Model
    start: BodyState
    body: int | None = None


class SpawnedBodies:
    """The bodies, by name, in the order in which they were spawned.

    They collide with everything and with each other. Their joints are braked, with the efforts of their limits. As the
    engine cannot forget that they were there, the world has to be loaded anew afterwards.

    Args:
        client: Physics client.
        names: Name of each surface that can press on the ball; those of the bodies are kept in it.
    """

    def __init__(self, client: int, names: dict[Surface, str]) -> None:
        self._client = client
        self._names = names
        self._bodies: dict[str, _Spawned] = {}
        self.friction = 0.0
        """Friction of bodies that are loaded from now on."""
        self.leaves_traces = False
        """Whether a body has been in the world since it was loaded."""

    def __contains__(self, name: str) -> bool:
        return name in self._bodies

    def __len__(self) -> int:
        return len(self._bodies)

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(self._bodies)

    def add(self, name: str, model: Model, start: BodyState) -> None:
        """Put a body into the world.

        Args:
            name: Its name, which no other body has.
            model: What it is.
            start: Its state; only the pose matters.

        Raises:
            RequestError: ``RESOURCE_PARSE_ERROR`` if the engine does not take it.
        """
        spawned = _Spawned(model, start)
        self._load(name, spawned)
        self._bodies[name] = spawned

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        spawned = self._bodies.pop(name)
        if spawned.body is not None:
            pybullet.removeBody(spawned.body, physicsClientId=self._client)
            for surface in [surface for surface in self._names if surface[0] == spawned.body]:
                del self._names[surface]

    def clear(self) -> None:
        """Take all bodies out of the world."""
        for name in self.entities:
            self.remove(name)

    def forget(self) -> None:
        """Take note that the world is being emptied; `load` then loads the bodies again."""
        for spawned in self._bodies.values():
            spawned.body = None
        self.leaves_traces = False

    def load(self) -> None:
        """Load all bodies that are not in the world, where they were spawned."""
        for name, spawned in self._bodies.items():
            if spawned.body is None:
                self._load(name, spawned)

    def model(self, name: str) -> Model:
        """What a body is."""
        return self._bodies[name].model

    def state(self, name: str) -> BodyState:
        """Where the root link of a body is and how it moves."""
        body = self._body(name)
        centre, turn = pybullet.getBasePositionAndOrientation(body, self._client)
        linear, angular = pybullet.getBaseVelocity(body, self._client)
        inward = pybullet.invertTransform(*self._inertial_frame(body))
        position, orientation = pybullet.multiplyTransforms(centre, turn, *inward)
        return BodyState(position, orientation, _shifted(linear, angular, centre, position), angular)

    def place(self, name: str, state: BodyState) -> None:
        """Put the root link of a body somewhere; its joints stay as they are."""
        body = self._body(name)
        centre, turn = pybullet.multiplyTransforms(state.position, state.orientation_xyzw, *self._inertial_frame(body))
        linear = _shifted(state.linear_velocity, state.angular_velocity, state.position, centre)
        pybullet.resetBasePositionAndOrientation(body, centre, turn, physicsClientId=self._client)
        pybullet.resetBaseVelocity(body, linear, state.angular_velocity, physicsClientId=self._client)

    def boxes(self, name: str) -> list[Box]:
        """Boxes along the axes of the world around the links of a body."""
        return boxes(self._client, self._body(name))

    def bounds(self, name: str) -> list[Box]:
        """Boxes along the axes of the root link around the links of a body."""
        body, model = self._body(name), self.model(name)
        angles = [pybullet.getJointState(body, joint, self._client)[0] for joint in links(self._client, body)[1:]]
        aside = connect()
        try:
            # Without the given inertia the engine's own axes, along which it measures, are those of the link.
            copy = _load(aside, model, BodyState((0.0, 0.0, 0.0)), flags=0)
            for joint, angle in enumerate(angles):
                pybullet.resetJointState(copy, joint, angle, physicsClientId=aside)
            return boxes(aside, copy)
        finally:
            pybullet.disconnect(aside)

    def _body(self, name: str) -> int:
        body = self._bodies[name].body
        if body is None:
            raise RequestError("RESULT_INCORRECT_STATE", f"{name}: there is no world until a reset succeeds")
        return body

    def _load(self, name: str, spawned: _Spawned) -> None:
        client = self._client
        self.leaves_traces = True
        body = spawned.body = _load(client, spawned.model, spawned.start)
        collide_with_everything(client, body)
        root = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
        self._names[body, BASE] = f"{name}/{root}"
        for link in links(client, body):
            # The ball alone decides how it bounces off what stands still; what moves does not bounce.
            pybullet.changeDynamics(
                body,
                link,
                lateralFriction=self.friction,
                restitution=float(spawned.model.is_static),
                linearDamping=0,
                angularDamping=0,
                physicsClientId=client,
            )
            if link != BASE:
                info = pybullet.getJointInfo(body, link, physicsClientId=client)
                self._names[body, link] = f"{name}/{info[_LINK_NAME].decode()}"
                if info[_JOINT_TYPE] != pybullet.JOINT_FIXED:
                    pybullet.setJointMotorControl2(
                        body, link, pybullet.VELOCITY_CONTROL, force=info[_LARGEST_EFFORT], physicsClientId=client
                    )

    def _inertial_frame(self, body: int) -> tuple[Vector, Quaternion]:
        """Centre of mass and principal axes in the root link, by which the engine locates a body."""
        info: Sequence[tuple[float, ...]] = pybullet.getDynamicsInfo(body, BASE, physicsClientId=self._client)
        position: Vector = tuple(info[_INERTIAL_POSITION])  # type: ignore[assignment]
        orientation: Quaternion = tuple(info[_INERTIAL_ORIENTATION])  # type: ignore[assignment]
        return position, orientation


def _load(client: int, model: Model, start: BodyState, *, flags: int = pybullet.URDF_USE_INERTIA_FROM_FILE) -> int:
    with tempfile.TemporaryDirectory(prefix="throwcollect-") as directory:
        path = Path(directory, "entity.urdf")
        path.write_text(model.urdf, encoding="utf-8")
        for number, triangles in enumerate(model.meshes):
            write_stl(path.with_name(f"{number}.stl"), triangles)
        try:
            return int(
                pybullet.loadURDF(
                    str(path),
                    basePosition=start.position,
                    baseOrientation=start.orientation_xyzw,
                    useFixedBase=model.is_fixed,
                    flags=flags,
                    physicsClientId=client,
                )
            )
        except pybullet.error as error:
            raise RequestError("RESOURCE_PARSE_ERROR", f"the physics engine cannot load it: {error}") from error


def _shifted(linear: Vector, angular: Vector, origin: Vector, other: Vector) -> Vector:
    """Velocity of another point of a body that turns."""
    x, y, z = (b - a for a, b in zip(origin, other, strict=True))
    u, v, w = angular
    return (linear[0] + v * z - w * y, linear[1] + w * x - u * z, linear[2] + u * y - v * x)
