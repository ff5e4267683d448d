"""Draws single pictures of what was recorded: robot, bodies and ground, and the path of the object with its end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.throw import Throw
from throwcollect.engines.pose import Pose
from throwcollect.episode.record import Samples
from throwcollect.extras import lazily
from throwcollect.robots.surroundings import looks_of
from throwcollect.sensing.camera import Camera, Frame
from throwcollect.sensing.scene import PlacedScene, Scene
from throwcollect.tasks.outcome_styles import style_of

images = lazily("PIL.Image")
drawing = lazily("PIL.ImageDraw")

FINE = 40_000
"""Triangles of all meshes of a scene: few enough to cost little, enough for faces and hands."""
SIZE = (640, 400)
"""Width and height of pictures [pixels]."""
Rgb = tuple[int, int, int]
HELD: Rgb = (150, 156, 164)
"""Colour of the path while the tool has the object."""
_OUTWARD = np.array([0.32, -1.0, 0.22])
"""Direction from a throw along x to the camera: a little in front of the robot, and a little above."""
_FAR_FLIGHT_M = 0.3
"""A flight at least this long has a direction."""
_TANGENT = 0.24
"""Tangent of half the vertical angle of view: small, so that lines hardly converge."""
_MARGIN = 0.06
"""Share of the picture that stays free on each side."""
_ROOM_M = 0.15
"""Rough distance by which the robot's shapes reach beyond the frames of its links."""
_CROSS_M = 0.1
_FINER = 2
"""Lines are drawn this many times as large and then made smaller, so that their edges are smooth."""


class DrawnThrow:
    """A throw that is drawn as it was recorded.

    Attributes:
        throw: The throw.
        samples: What was recorded.
        times_s: Times of the samples since the start of the trial [s], shape ``(n,)``.
        flight: Path of the object's centre after it left the tool [m], shape ``(n, 3)``.
        color: Color of the flight, and of the cross at its end: that of the outcome.
    """

    def __init__(self, throw: Throw, config: Config, scene: Scene) -> None:
        self.throw, self._config, self._scene = throw, config, scene
        red, green, blue = bytes.fromhex(style_of(throw.outcome, config.task.success).colour[1:])
        self.color: Rgb = (red, green, blue)
        self.samples = throw.read_samples()[1]
        self.times_s = self.samples.seconds_since(self.samples.stamps_ns[0])
        left = throw.events.left
        self._left = len(self.samples) if left is None else int(np.searchsorted(self.times_s, left.time_s))
        self.flight = self.samples.object_position[self._left :]
        self._drawn: tuple[tuple[int, Camera, bool], NDArray[np.uint8]] | None = None

    def find_points(self) -> NDArray[np.float64]:
        """Find points in world [m] around all that its pictures should show, shape ``(n, 3)``."""
        # The mount, or the feet, stand at the origin.
        points = [self.samples.object_position, np.zeros((1, 3))]
        # What the task is about is always in the picture; other bodies may be as large as a room.
        for look in (each for each in looks_of(self._config) if each.name in self._config.task.bodies):
            if not look.moves:
                low, *_, high = sorted(z for _, z in look.side_m)
                points.append(np.array([(*corner, z) for corner in look.above_m for z in (low, high)]))
        for number in np.linspace(0, len(self.samples) - 1, 40).astype(int):
            points.append(_surround(self._scene.place_sample(self.samples, number)))
        return np.concatenate(points)

    def draw(self, camera: Camera, time_s: float, *, marks: bool) -> NDArray[np.uint8]:
        """Draw its first sample not before a time, or its last one, shape ``(height, width, 3)``.

        With marks, the picture has the path of the object so far and, in the last sample, a cross where it ended.
        """
        number = min(int(np.searchsorted(self.times_s, time_s)), len(self.samples) - 1)
        asked = number, camera, marks
        # A throw that has ended stays in pictures of longer ones.
        if self._drawn is None or self._drawn[0] != asked:
            self._drawn = asked, self._draw(*asked)
        return self._drawn[1]

    def _draw(self, number: int, camera: Camera, marks: bool) -> NDArray[np.uint8]:
        placed = self._scene.place_sample(self.samples, number)
        frame = camera.render(placed)
        assert frame.color is not None  # noqa: S101 - it was asked for
        if not marks:
            return frame.color
        path = self.samples.object_position[: number + 1]
        lines = [(path[: self._left + 1], HELD), (path[self._left :], self.color)]
        if self.throw.events.end is not None and number == len(self.samples) - 1:
            along = np.linspace(-_CROSS_M, _CROSS_M, 25)[:, np.newaxis]
            end = self.throw.events.end.position
            lines += [(end + along * np.array(way), self.color) for way in ((1.0, 1.0, 0.0), (1.0, -1.0, 0.0))]
        return _mark(frame, camera, camera.find_optical(placed), lines)


def _surround(placed: PlacedScene) -> NDArray[np.float64]:
    """Find points around the links of the robot, whose labels come first, before that of the object."""
    names = placed.scene.labels[1 : placed.scene.ground - 1]
    frames = np.array([placed.find(name).origin for name in names])
    return np.concatenate([frames - _ROOM_M, frames + _ROOM_M])


def _mark(
    frame: Frame,
    camera: Camera,
    optical: Pose,
    lines: Sequence[tuple[NDArray[np.float64], tuple[int, int, int]]],
) -> NDArray[np.uint8]:
    """Draw lines through points in world [m], shape ``(n, 3)``, where nothing is in front of them."""
    above = images.new("RGBA", (camera.width * _FINER, camera.height * _FINER))
    pen = drawing.Draw(above)
    thick = max(_FINER, round(camera.width * _FINER / 320))
    for points, color in lines:
        pixels, depth = project(camera, optical, points)
        column, row = np.clip(pixels.astype(int), 0, (camera.width - 1, camera.height - 1)).T
        hidden = (depth <= camera.near_m) | (depth > frame.depth[row, column])
        # Each part begins with a hidden point, but perhaps the first one.
        for part in np.split(np.arange(len(points)), np.flatnonzero(hidden)):
            shown = part[~hidden[part]]
            if len(shown) > 1:
                pen.line([tuple(each) for each in (pixels[shown] * _FINER).tolist()], color, thick, joint="curve")
    picture = images.fromarray(frame.color).convert("RGBA")
    picture.alpha_composite(above.reduce(_FINER))
    return np.asarray(picture.convert("RGB"))


def project(
    camera: Camera, optical: Pose, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find where points in world [m], shape ``(n, 3)``, are in a picture.

    Returns:
        Pixels to the right and downwards from its upper left corner, shape ``(n, 2)``, and distances along the optical
        axis [m], shape ``(n,)``; pixels of points that are not in front of the camera mean nothing.
    """
    seen = (points - np.array(optical.origin)) @ np.array(optical.rows)
    depth = seen[:, 2]
    pixels = seen[:, :2] * camera.focal_px / np.maximum(depth, 1e-6)[:, np.newaxis]
    middle = np.array([camera.width / 2, camera.height / 2])
    return np.clip(pixels + middle, -1e6, 1e6), depth


def camera_for(throws: Sequence[DrawnThrow], size: tuple[int, int]) -> Camera:
    """Place a camera that sees all of some throws, on the right of the way that they go together."""
    ways = np.array([each.flight[-1] - each.flight[0] for each in throws if len(each.flight)] or [np.zeros(3)])
    x, y, _ = ways.mean(axis=0)
    heading = math.atan2(y, x) if math.hypot(x, y) >= _FAR_FLIGHT_M else 0.0
    return camera_on(np.concatenate([each.find_points() for each in throws]), size, heading)


def camera_on(points: NDArray[np.float64], size: tuple[int, int] = SIZE, heading: float = 0.0) -> Camera:
    """Place a camera as near as possible with all points in its picture, on the right of a throw.

    The points are in world [m], shape ``(n, 3)``; the size is that of the picture [pixels]; the heading is the angle
    from x to the direction of the throw [rad].
    """
    # Below the ground, there is nothing to see.
    points = np.column_stack([points[:, :2], np.maximum(points[:, 2], 0)])
    cos, sin = math.cos(heading), math.sin(heading)
    back = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ _OUTWARD / np.linalg.norm(_OUTWARD)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    # From here on the places are in the frame of the camera, whose third axis points backwards.
    axes = np.stack([right, np.cross(back, right), back])
    seen = points @ axes.T
    # A point is in the picture if its distance from the axis is below the tangent times its distance along the axis.
    place = np.empty(3)
    needed = []
    for axis, tangent in ((0, _TANGENT * size[0] / size[1]), (1, _TANGENT)):
        slope = tangent * (1 - 2 * _MARGIN)
        upper, lower = np.max(seen[:, axis] + slope * seen[:, 2]), np.max(-seen[:, axis] + slope * seen[:, 2])
        # The two outermost lines of this slope, one on each side, meet at the nearest place that sees all points.
        place[axis] = (upper - lower) / 2
        needed.append((upper + lower) / (2 * slope))
    place[2] = max(needed)
    eye = place @ axes
    pose = Pose.looking_at(eye.tolist(), (eye - back).tolist())
    return Camera(*size, 2 * math.atan(_TANGENT), pose=pose, smooth=True)


class Still:
    """Draws single pictures of a world of a configuration, from one place."""

    def __init__(self, config: Config) -> None:
        self._scene = Scene.of(config, triangles=FINE)
        self._camera: Camera | None = None

    def draw(self, samples: Samples) -> NDArray[np.uint8]:
        """Draw the first sample, shape ``(400, 640, 3)``; the first call chooses the place of the camera."""
        placed = self._scene.place_sample(samples, 0)
        if self._camera is None:
            # A throw ends some two metres in front of the robot.
            front = np.add(samples.object_position[:1], (2.0, 0.0, 0.5))
            self._camera = camera_on(np.concatenate([_surround(placed), front, [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]]))
        picture = self._camera.render(placed).color
        assert picture is not None  # noqa: S101 - it was asked for
        return picture
