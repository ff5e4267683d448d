"""Bodies that are added to a Bullet world: obstacles, tables, other robots."""

from __future__ import annotations

from collections.abc import Sequence

import pybullet

from throwcollect.engines.body import BodyModel, Vector
from throwcollect.engines.bullet.scenery import BASE, Surface, boxes, collide_with_everything, connect, links, load_body
from throwcollect.engines.engine import Bodies, BodyState, Box, Quaternion
from throwcollect.errors import ConfigError, RequestError

# These are places in what `getJointInfo` and `getDynamicsInfo` return (PyBullet Quickstart Guide).
_JOINT_TYPE, _LARGEST_EFFORT, _LINK_NAME = 2, 10, 12
_INERTIAL_POSITION, _INERTIAL_ORIENTATION = 3, 4


class BulletBodies(Bodies):
    """The bodies of one world. Their joints are braked, with the efforts of their limits.

    Args:
        client: Physics client.
        names: Name of each surface that can press on the ball; this object adds and removes those of its bodies.
    """

    def __init__(self, client: int, names: dict[Surface, str]) -> None:
        self._client = client
        self._names = names
        self._bodies: dict[str, tuple[int, BodyModel]] = {}
        self.friction = 0.0
        """Friction of bodies that are added from now on."""
        self.leave_traces = False
        """A body has been in the world since it was loaded; removing it does not remove all its effects on Bullet."""

    def __contains__(self, name: object) -> bool:
        return name in self._bodies

    def forget(self) -> None:
        """Take note that the world was emptied."""
        self._bodies.clear()
        self.leave_traces = False

    def add(self, name: str, model: BodyModel, start: BodyState) -> None:
        """Put a body into the world; see `Bodies.add`."""
        client = self._client
        # This is set before the body is loaded, because a body that Bullet refuses may leave traces, too.
        self.leave_traces = True
        try:
            body = load_body(client, model, start.position, start.orientation_xyzw)
        except ConfigError as error:
            raise RequestError("RESOURCE_PARSE_ERROR", error.message) from error
        self._bodies[name] = body, model
        collide_with_everything(client, body)
        root = pybullet.getBodyInfo(body, physicsClientId=client)[0].decode()
        self._names[body, BASE] = f"{name}/{root}"
        for link in links(client, body):
            # The ball's restitution alone counts where it hits a body at rest; off a moving body it does not bounce.
            pybullet.changeDynamics(
                body,
                link,
                lateralFriction=self.friction,
                restitution=float(model.is_static),
                linearDamping=0,
                angularDamping=0,
                physicsClientId=client,
            )
            if link != BASE:
                info = pybullet.getJointInfo(body, link, physicsClientId=client)
                self._names[body, link] = f"{name}/{info[_LINK_NAME].decode()}"
                # A velocity motor whose target is not named holds a joint at 0 rad/s, with this torque at most.
                if info[_JOINT_TYPE] != pybullet.JOINT_FIXED:
                    pybullet.setJointMotorControl2(
                        body, link, pybullet.VELOCITY_CONTROL, force=info[_LARGEST_EFFORT], physicsClientId=client
                    )

    def remove(self, name: str) -> None:
        """Take a body out of the world."""
        body, _ = self._bodies.pop(name)
        pybullet.removeBody(body, physicsClientId=self._client)
        for surface in [surface for surface in self._names if surface[0] == body]:
            del self._names[surface]

    def state(self, name: str) -> BodyState:
        """Find pose and velocity of the root link of a body."""
        body, _ = self._bodies[name]
        centre, turn = pybullet.getBasePositionAndOrientation(body, self._client)
        linear, angular = pybullet.getBaseVelocity(body, self._client)
        inward = pybullet.invertTransform(*self._find_inertial_frame(body))
        position, orientation = pybullet.multiplyTransforms(centre, turn, *inward)
        return BodyState(position, orientation, _find_velocity_at(linear, angular, centre, position), angular)

    def place(self, name: str, state: BodyState) -> None:
        """Set pose and velocity of the root link of a body; its joints stay as they are."""
        body, _ = self._bodies[name]
        centre, turn = pybullet.multiplyTransforms(
            state.position, state.orientation_xyzw, *self._find_inertial_frame(body)
        )
        linear = _find_velocity_at(state.linear_velocity, state.angular_velocity, state.position, centre)
        pybullet.resetBasePositionAndOrientation(body, centre, turn, physicsClientId=self._client)
        pybullet.resetBaseVelocity(body, linear, state.angular_velocity, physicsClientId=self._client)

    def boxes(self, name: str) -> list[Box]:
        """Find the boxes around the links of a body, along the axes of the world."""
        return boxes(self._client, self._bodies[name][0])

    def bounds(self, name: str) -> list[Box]:
        """Find the boxes around the links of a body, along the axes of its root link."""
        body, model = self._bodies[name]
        angles = [pybullet.getJointState(body, joint, self._client)[0] for joint in links(self._client, body)[1:]]
        # In a world of its own, where the copy stands unturned at the origin, the axes of the world are those of the
        # root link.
        aside = connect()
        try:
            # Bullet measures along its own axes of a link; those are the link's axes unless an inertia is given.
            copy = load_body(aside, model, (0.0, 0.0, 0.0), flags=0)
            for joint, angle in enumerate(angles):
                pybullet.resetJointState(copy, joint, angle, physicsClientId=aside)
            return boxes(aside, copy)
        finally:
            pybullet.disconnect(aside)

    def _find_inertial_frame(self, body: int) -> tuple[Vector, Quaternion]:
        """Find centre of mass and principal axes in the root link; by these the engine locates a body."""
        info: Sequence[tuple[float, ...]] = pybullet.getDynamicsInfo(body, BASE, physicsClientId=self._client)
        position: Vector = tuple(info[_INERTIAL_POSITION])  # type: ignore[assignment]
        orientation: Quaternion = tuple(info[_INERTIAL_ORIENTATION])  # type: ignore[assignment]
        return position, orientation


def _find_velocity_at(linear: Vector, angular: Vector, origin: Vector, other: Vector) -> Vector:
    """Find the velocity of another point of a body that turns."""
    x, y, z = (b - a for a, b in zip(origin, other, strict=True))
    u, v, w = angular
    return (linear[0] + v * z - w * y, linear[1] + w * x - u * z, linear[2] + u * y - v * x)
