"""Pictures of robot and bodies by Bullet's software renderer: no screen, no GPU, and nothing is simulated."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pybullet
from numpy.typing import NDArray

from throwcollect.engines.body import Vector
from throwcollect.engines.bullet.scenery import BASE, connect, links, load_bodies, load_urdf, place_body
from throwcollect.engines.engine import BodyState, SceneBody
from throwcollect.errors import ConfigError

Rgba = tuple[float, float, float, float]

_BACKGROUND = -1


class Renderer:
    """A robot and bodies in poses that a camera sees; a context manager.

    Args:
        urdf: URDF text of the robot; paths of meshes are absolute.
        base_height_m: Height of its base above the ground [m].
        bodies: Bodies that stand in the world, each with its colour.

    Raises:
        ConfigError: If Bullet cannot load the description.
        WorkerError: If Bullet refuses to start another world in this process.
    """

    def __init__(
        self,
        urdf: str,
        base_height_m: float,
        bodies: Sequence[tuple[SceneBody, Rgba]] = (),
    ) -> None:
        heavy = _add_masses(urdf)
        self._client = connect()
        try:
            with tempfile.TemporaryDirectory(prefix="throwcollect-") as directory:
                place = (0.0, 0.0, base_height_m)
                self._robot = load_urdf(self._client, heavy, Path(directory), place)
        except ConfigError:
            pybullet.disconnect(self._client)
            raise
        self._joints = {
            pybullet.getJointInfo(self._robot, number, physicsClientId=self._client)[1].decode(): number
            for number in links(self._client, self._robot)
            if number != BASE
        }
        loaded = load_bodies(self._client, [body for body, _ in bodies])
        for number, (_, rgba) in zip(loaded, bodies, strict=True):
            pybullet.changeVisualShape(number, BASE, rgbaColor=rgba, physicsClientId=self._client)
        self._moving = [(number, body) for number, body in loaded.items() if body.moves]

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self._client)

    def place(self, joints: Mapping[str, float], bodies: Sequence[BodyState]) -> None:
        """Put joints at angles [rad], and bodies that move into their poses, in the order in which they were given.

        Other joints stay at 0.
        """
        for name, angle in joints.items():
            pybullet.resetJointState(self._robot, self._joints[name], angle, physicsClientId=self._client)
        for each, state in zip(self._moving, bodies, strict=True):
            place_body(self._client, *each, state)

    def find_frames(self) -> list[Vector]:
        """Find the origins of the frames of the robot's links in world [m]."""
        states = pybullet.getLinkStates(
            self._robot, list(self._joints.values()), computeForwardKinematics=True, physicsClientId=self._client
        )
        return [state[4] for state in states]

    def draw(
        self, width: int, height: int, *, view: Sequence[float], projection: Sequence[float], light: Vector
    ) -> NDArray[np.uint8]:
        """Draw the picture of a camera.

        Args:
            width: Width of the picture in pixels.
            height: Its height.
            view: World to camera as OpenGL has it: 16 numbers, column by column.
            projection: Camera to clip space, in the same form.
            light: Direction from which the light comes.

        Returns:
            Red, green, blue, and 255 for robot and bodies, 0 for the background; shape ``(height, width, 4)``.
        """
        _, _, colors, _, objects = pybullet.getCameraImage(
            width,
            height,
            view,
            projection,
            lightDirection=light,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        picture = np.array(colors, np.uint8).reshape(height, width, 4)
        picture[..., 3] = np.where(np.array(objects).reshape(height, width) == _BACKGROUND, 0, 255)
        return picture


def _add_masses(urdf: str) -> str:
    """Give every link of a description a mass: Bullet prints a warning to standard output for each link without one."""
    robot = ElementTree.fromstring(urdf)  # noqa: S314 - the dataset's own description
    for link in robot.iter("link"):
        if link.find("inertial") is None:
            inertial = ElementTree.SubElement(link, "inertial")
            ElementTree.SubElement(inertial, "mass", value="1")
            ElementTree.SubElement(inertial, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
    return ElementTree.tostring(robot, encoding="unicode")
