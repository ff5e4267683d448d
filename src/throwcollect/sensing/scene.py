"""The robot and the bodies of a trial as triangles, and where they are in a recorded state."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.engines.body import Vector
from throwcollect.engines.engine import GROUND
from throwcollect.engines.pose import Pose
from throwcollect.episode.frames import WORLD, Frame, FrameTree, read_frames
from throwcollect.episode.record import Samples
from throwcollect.episode.sensor_topics import label_names
from throwcollect.errors import ConfigError
from throwcollect.reproducible_math import cos, sin
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import moving_bodies_of
from throwcollect.sensing.decimation import Points, cross, dot
from throwcollect.sensing.drawn_robot import DrawnRobot, DrawnShape, draw_bodies_of, draw_robot_of
from throwcollect.sensing.surface import COARSE, Surface, surfaces_of


class Joint(NamedTuple):
    """A joint: the part that it hangs on, its frame in that part at 0, its axis, and its column in recorded states."""

    parent: int
    frame: Frame
    offset: Pose
    column: int


class Scene:
    """All that sensors see of one configuration: the robot, the bodies, and the ground.

    What moves together is a part: number 0 is all that stands, then comes what each joint moves, then each body that
    moves. Corners and triangles are listed part by part.

    Attributes:
        labels: What the numbers in pictures of labels mean (`label_names`).
        ground: Number in `labels` of the ground.
        links: The part that each link belongs to, and its pose in it; with bodies that move and the world.
        n_moving: Number of bodies that move.
        corners: In the frames of their parts [m], shape ``(3, n_corners)``.
        corners_of: How many corners each part has, shape ``(n_parts,)``.
        balls: Centre and radius of a ball around each part, in its frame [m].
        faces: Numbers of the corners of triangles, shape ``(3, n)``.
        parts: The part of each triangle, shape ``(n,)``.
        planes: Normal of each triangle, as long as its area is large, and the product of this normal with a point of
            the triangle, shape ``(4, n)``.
        normals: Unit vectors at the corners of each triangle, shape ``(3, 3, n)``: corner, axis.
        labels_of: Number in `labels` of each triangle, shape ``(n,)``.
        colors: Red, green and blue from 0 to 1 of each triangle, shape ``(3, n)``.
    """

    def __init__(
        self,
        robot: DrawnRobot,
        joints: Sequence[str],
        base_height_m: float,
        bodies: Sequence[DrawnShape],
        moving: Sequence[str],
        *,
        triangles: int = COARSE,
    ) -> None:
        """Make a scene.

        Args:
            robot: The robot, with its tool, as viewers draw it.
            joints: Names of the joints in the order of recorded positions.
            base_height_m: Height of its root above the ground.
            bodies: Shapes of the bodies, in the frame of the world, or of a body that moves.
            moving: Names of the bodies that move, the object first.
            triangles: Largest number of triangles of all meshes together; those of files are made coarser.
        """
        tree = read_frames(robot.urdf, base_height=base_height_m)
        self._joints: list[Joint] = []
        links = self._find_parts(tree, {name: column for column, name in enumerate(joints)})
        free = {name: (1 + len(self._joints) + number, Pose()) for number, name in enumerate(moving)}
        # A robot may have a link with the name of the world, too, which then stands at the height of the base.
        self.links = {**links, **free, WORLD: (0, Pose())}
        self.labels = label_names(tree.links, moving[0], dict.fromkeys(shape.name for shape in bodies))
        self.ground = self.labels.index(GROUND)
        self.n_moving = len(moving)
        drawn = [(links[shape.link], shape) for shape in robot.shapes]
        drawn += [(self.links[shape.link], shape) for shape in bodies]
        drawn.sort(key=lambda each: each[0][0])
        files = robot.meshes | {shape.mesh: Path(shape.mesh) for shape in bodies if shape.mesh}
        made = surfaces_of([shape for _, shape in drawn], files, triangles)
        surfaces = [surface.place(pose) for ((_, pose), _), surface in zip(drawn, made, strict=True)]
        self._join(surfaces, np.array([part for (part, _), _ in drawn], np.int64), 1 + len(self._joints) + len(moving))
        many = [surface.faces.shape[1] for surface in surfaces]
        numbers = np.array([self.labels.index(shape.name) for _, shape in drawn], np.uint16)
        colors = np.array([shape.rgba[:3] for _, shape in drawn], np.float32).reshape(-1, 3).T
        self.labels_of, self.colors = np.repeat(numbers, many), np.repeat(colors, many, axis=1)

    @staticmethod
    def of(config: Config, *, description: str | None = None, triangles: int = COARSE) -> Scene:
        """Make the scene of a configuration.

        Args:
            config: The configuration.
            description: URDF text of the robot with its tool as it was recorded; written anew by default, which needs
                Pinocchio.
            triangles: Largest number of triangles of all meshes together.
        """
        robot, bodies, moving = draw_robot_of(config, description), draw_bodies_of(config), moving_bodies_of(config)
        joints, base_height_m = robot_of(config).joints, config.robot.base_height_m
        return make_scene(robot, joints, base_height_m, bodies, moving, triangles=triangles)

    def _find_parts(self, tree: FrameTree, columns: Mapping[str, int]) -> dict[str, tuple[int, Pose]]:
        """Find the part of each link, and its pose in it; number 0 is all that stands."""
        found, waiting = {WORLD: (0, Pose())}, [*tree.fixed, *tree.moving]
        while waiting:
            later: list[Frame] = []
            for frame in waiting:
                if frame.parent not in found:
                    later.append(frame)
                    continue
                part, pose = found[frame.parent]
                offset = pose * Pose.of(frame.translation, frame.rotation_xyzw)
                if frame.joint:
                    self._joints.append(Joint(part, frame, offset, columns[frame.joint]))
                    part, offset = len(self._joints), Pose()
                found[frame.child] = part, offset
            waiting = later
        return found

    def _join(self, surfaces: Sequence[Surface], owners: NDArray[np.int64], count: int) -> None:
        """List all corners and triangles; the surfaces are sorted by the part that owns each."""
        sizes = [surface.corners.shape[1] for surface in surfaces]
        begins = np.cumsum([0, *sizes])
        self.corners = np.concatenate([np.zeros((3, 0)), *(each.corners for each in surfaces)], axis=1)
        self.corners_of = np.bincount(np.repeat(owners, sizes), minlength=count)
        numbered = [each.faces + begin for each, begin in zip(surfaces, begins, strict=False)]
        self.faces = np.concatenate([np.zeros((3, 0), np.int64), *numbered], axis=1)
        self.parts = np.repeat(owners, [each.shape[1] for each in numbered])
        self.normals = np.concatenate([np.zeros((3, 3, 0)), *(each.normals for each in surfaces)], axis=2)
        a, b, c = (self.corners[:, each] for each in self.faces)
        normal = cross(b - a, c - a)
        self.planes = np.concatenate([normal, dot(normal, a)[np.newaxis]])
        self.balls = [_surround(each) for each in np.split(self.corners, np.cumsum(self.corners_of)[:-1], axis=1)]

    def place(self, positions: Iterable[float], bodies: Sequence[Pose] = ()) -> PlacedScene:
        """Put robot and bodies where they are.

        Args:
            positions: Position of each joint [rad or m], in the order of `Robot.joints`.
            bodies: Poses in world of the bodies that move, the object first.
        """
        values = np.array([*positions], float)
        # Every processor computes these alike, which the functions of C do not promise.
        sines, cosines = sin(values / 2).tolist(), cos(values / 2).tolist()
        poses = [Pose()]
        for joint in self._joints:
            value, (x, y, z) = float(values[joint.column]), joint.frame.axis
            if joint.frame.slides:
                motion = Pose(origin=(x * value, y * value, z * value))
            else:
                sine, cosine = sines[joint.column], cosines[joint.column]
                motion = Pose.of((0.0, 0.0, 0.0), (x * sine, y * sine, z * sine, cosine))
            poses.append(poses[joint.parent] * joint.offset * motion)
        return PlacedScene(self, (*poses, *bodies))

    def place_sample(self, samples: Samples, number: int) -> PlacedScene:
        """Put robot and bodies where they are in a recorded sample."""
        parts = [samples[number : number + 1].parts_of(body) for body in range(self.n_moving)]
        return self.place(samples.position[number], [Pose.of(place[0], turn[0]) for place, turn, *_ in parts])


make_scene = lru_cache(maxsize=4)(Scene)
"""Makes a `Scene`, or returns an earlier one in which nothing differs but what moves, such as that of another trial."""


# Scenes in one state are keys of a cache.
@dataclass(frozen=True, eq=False)
class PlacedScene:
    """A scene in one state.

    Attributes:
        scene: The scene.
        poses: Pose in world of each part.
    """

    scene: Scene
    poses: tuple[Pose, ...]

    def find(self, link: str) -> Pose:
        """Find the pose in world of a link, a body that moves, or the world itself."""
        if link not in self.scene.links:
            raise ConfigError(f"link: there is no link {link}", expected=" or ".join(self.scene.links))
        part, within = self.scene.links[link]
        return self.poses[part] * within


def _surround(corners: Points) -> tuple[Vector, float]:
    """Find centre and radius of a ball around corners and their origin [m]."""
    x, y, z = ((corners.min(axis=1, initial=0.0) + corners.max(axis=1, initial=0.0)) / 2).tolist()
    away = corners - np.array([[x], [y], [z]])
    return (x, y, z), math.sqrt(float(dot(away, away).max(initial=0.0)))
