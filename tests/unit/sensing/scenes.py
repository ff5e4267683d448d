"""Small scenes for tests of sensors: bodies in the world, without a robot or with a simple one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import Placement, Vector, turn_of
from throwcollect.engines.pose import Pose
from throwcollect.episode.frames import WORLD
from throwcollect.sensing.camera import Camera
from throwcollect.sensing.drawn_robot import DrawnShape, read_drawn_robot
from throwcollect.sensing.scene import PlacedScene, Scene

NO_ROBOT = '<robot name="none"><link name="root"/></robot>'


def make_shape(name: str, kind: str, size: Sequence[float], at: Sequence[float], link: str = WORLD) -> DrawnShape:
    """Make an orange body."""
    return DrawnShape(link, tuple(at), (0.0, 0.0, 0.0, 1.0), tuple(size), kind, "", (1.0, 0.5, 0.0, 1.0), name)


def make_pose(origin: Vector, rpy_rad: Vector = (0.0, 0.0, 0.0)) -> Pose:
    """Make the pose of an origin [m] and of rotations about the parent's axes x, y, z in this order [rad]."""
    return Pose.of(origin, turn_of(Placement(rpy=rpy_rad)))


def make_matrix(camera: Camera) -> NDArray[np.float64]:
    """Make the intrinsic matrix of ROS and OpenCV, for which the middle of the first pixel is at 0, 0."""
    focal = camera.focal_px
    return np.array([[focal, 0, (camera.width - 1) / 2], [0, focal, (camera.height - 1) / 2], [0, 0, 1]])


def make_scene(*shapes: DrawnShape, urdf: str = NO_ROBOT, joints: Sequence[str] = ()) -> Scene:
    """Make a scene of bodies that stand, and of a ball with a radius of 0.1 m that can be put anywhere."""
    ball = make_shape("ball", "sphere", (0.2, 0.2, 0.2), (0.0, 0.0, 0.0), "ball")
    return Scene(read_drawn_robot(urdf, "none", Path), joints, 0.5, [*shapes, ball], ["ball"])


def place_ball(at: tuple[float, float, float], *shapes: DrawnShape) -> PlacedScene:
    """Put the ball somewhere among bodies that stand."""
    return make_scene(*shapes).place([], [Pose(origin=at)])
