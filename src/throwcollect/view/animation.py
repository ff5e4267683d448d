"""Draws a stored throw as an animated picture: robot and bodies as recorded, ground, and path of the object."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.throw import Throw
from throwcollect.engines.bullet.renderer import Renderer
from throwcollect.engines.engine import body_of
from throwcollect.episode.record import Samples
from throwcollect.errors import ConfigError
from throwcollect.extras import lazily, require
from throwcollect.files import write_file
from throwcollect.robots.description import robot_of
from throwcollect.robots.surroundings import bodies_of, looks_of, object_of, starts_in_tool
from throwcollect.sensing.drawn_robot import draw_bodies_of, draw_robot_of
from throwcollect.tasks.outcome_styles import style_of
from throwcollect.view.viewer_directory import choose_throws

_OUTWARD = np.array([0.32, -1.0, 0.22])
"""Direction from a throw along x to the camera: a little in front of the robot, and a little above."""
_FAR_FLIGHT_M = 0.3
"""A flight at least this long has a direction."""
_TANGENT = 0.24
"""Tangent of half the vertical angle of view: small, so that lines hardly converge."""
_NEAR_M, _FAR_M = 0.1, 100.0
_NEAREST_M = 0.5
_MARGIN = 0.06
"""Share of the picture that stays free on each side."""


images = lazily("PIL.Image")
drawing = lazily("PIL.ImageDraw")

_FORMATS = MappingProxyType({".webp": "WEBP", ".gif": "GIF"})
_WIDTH, _HEIGHT = 640, 400
_FINER = 1.5
"""Pictures are drawn this many times as large and then made smaller, because the renderer does not smooth edges."""
_FRAME_MS = 50
_LAST_FRAME_MS = 1200
_LIGHT = (2.0, -5.0, 8.0)
_ROOM_M = 0.15
"""Rough distance by which the robot's shapes reach beyond the frames of its links."""
_GRID_M = 0.5
# The components are multiples of four, as Pillow uses only their upper six bits to find the nearest colour of a GIF.
_SKY, _GROUND, _LINE = (244, 248, 252), (232, 236, 240), (208, 216, 224)
_HELD = (150, 156, 164)


@dataclass(frozen=True)
class Animation:
    """An animated picture that was written; its duration [s] does not include the time of the last picture."""

    file: Path
    trial: int
    pictures: int
    duration_s: float
    size_bytes: int


def render(directory: Path, output: Path, *, trial: int | None = None, slow: float = 1.0) -> Animation:
    """Draw a throw of a dataset, by default the first one that has an episode, `slow` times slower than real time.

    `output` is a ``.webp`` or ``.gif`` file, which replaces an existing one.
    """
    kind = _FORMATS.get(output.suffix.lower())
    if kind is None:
        raise ConfigError(
            f"{output}: no animated picture ends like this", expected=f"a name with {' or '.join(_FORMATS)}"
        )
    require("PIL")
    dataset = Dataset.open(directory)
    throw = choose_throws(dataset, None if trial is None else [trial])[0]
    colour = style_of(throw.outcome, dataset.config.task.success).colour
    pictures = _draw_all(throw, dataset.config_of(throw), slow, colour)
    if kind == "GIF":
        pictures = _reduce_colours(pictures, colour)
    times = [_FRAME_MS] * (len(pictures) - 1) + [_LAST_FRAME_MS]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer, kind, save_all=True, append_images=pictures[1:], duration=times, loop=0, quality=80, method=4
    )
    write_file(output, buffer.getvalue())
    shown_s = (len(pictures) - 1) * _FRAME_MS / 1000
    return Animation(output, throw.trial, len(pictures), shown_s, len(buffer.getvalue()))


def _draw_all(throw: Throw, config: Config, slow: float, colour: str) -> list[Any]:
    """Draw the pictures of a throw, one every `_FRAME_MS`, and its last sample, with a flight of this colour."""
    (_, samples), landing = throw.read_samples(), throw.events.end
    joints = robot_of(config).joints
    times_s = samples.seconds_since(samples.stamps_ns[0])
    shown = [*np.searchsorted(times_s, np.arange(0, times_s[-1], _FRAME_MS / 1000 / slow)), len(samples) - 1]
    left = throw.events.left
    released = len(samples) if left is None else int(np.searchsorted(times_s, left.time_s))
    with _open_renderer(config) as renderer:
        # The mount, or the feet, stand at the origin.
        points = [samples.object_position, np.zeros((1, 3))]
        # What the task is about is always in the picture; other bodies may be as large as a room.
        for look in (each for each in looks_of(config) if each.name in config.task.bodies and not each.moves):
            low, *_, high = sorted(z for _, z in look.side_m)
            points.append(np.array([(*corner, z) for corner in look.above_m for z in (low, high)]))
        for number in shown:
            place(renderer, joints, samples, number)
            frames = np.array(renderer.find_frames())
            points += [frames - _ROOM_M, frames + _ROOM_M]
        everything = np.concatenate(points)
        # The box around the feet would reach below the ground, where there is nothing to see.
        everything[:, 2] = np.maximum(everything[:, 2], 0)
        camera = camera_on(everything, _WIDTH / _HEIGHT, _find_heading(samples.object_position[released:]))
        ground = Ground(camera, everything[:, :2].mean(axis=0))
        pictures = []
        for number in shown:
            place(renderer, joints, samples, number)
            picture = ground.picture()
            path = samples.object_position[: number + 1]
            end = landing.position if landing and number == shown[-1] else None
            if flies := starts_in_tool(config):
                ground.shade(picture, path[-1])
                ground.mark(picture, path, released, end, colour)
            ground.paste(picture, renderer)
            # What slides on a body would have its path behind the picture of that body.
            if not flies:
                ground.mark(picture, path, released, end, colour)
            pictures.append(picture.resize((_WIDTH, _HEIGHT), images.Resampling.LANCZOS))
    return pictures


def _open_renderer(config: Config) -> Renderer:
    """Make a renderer of the robot and all bodies of a configuration, the object last."""
    colours = {look.name: shape.rgba for look, shape in zip(looks_of(config), draw_bodies_of(config), strict=True)}
    bodies = [(body, colours[body.link.name]) for body in (*bodies_of(config), object_of(config))]
    return Renderer(draw_robot_of(config).urdf_with_files, config.robot.base_height_m, bodies)


def _find_heading(flight: NDArray[np.float64]) -> float:
    """Find the angle from x to the direction of a flight, seen from above [rad]; 0 if it leads nowhere."""
    x, y, _ = flight[-1] - flight[0] if len(flight) else np.zeros(3)
    return float(np.arctan2(y, x)) if np.hypot(x, y) >= _FAR_FLIGHT_M else 0.0


def _reduce_colours(pictures: list[Any], flight: str) -> list[Any]:
    """Give pictures the 256 colours that a GIF can have.

    Thin lines have so few pixels that their colours would not be chosen. So the colours of lines, and of their smooth
    edges on the ground, are set here.
    """
    ground = np.array(_GROUND)
    fixed = [_SKY, _GROUND, _LINE] + [
        tuple(np.round(ground + share * (np.array(color) - ground)).astype(int).tolist())
        for color in (_HELD, tuple(bytes.fromhex(flight[1:])))
        for share in (0.25, 0.5, 0.75, 1.0)
    ]
    others = pictures[-1].quantize(256 - len(fixed)).getpalette()
    palette = images.new("P", (1, 1))
    palette.putpalette([value for color in fixed for value in color] + others)
    return [picture.quantize(palette=palette, dither=images.Dither.NONE) for picture in pictures]


def place(renderer: Renderer, joints: tuple[str, ...], samples: Samples, number: int) -> None:
    """Put robot and bodies where they are in a sample."""
    angles = map(float, samples.position[number])
    row = samples[number : number + 1]
    moving = (*range(1, samples.bodies.shape[1] + 1), 0)
    bodies = [body_of(tuple(np.hstack(row.parts_of(each))[0].tolist())) for each in moving]
    renderer.place(dict(zip(joints, angles, strict=True)), bodies)


class Ground:
    """Draws the ground, with lines every half metre, and everything on it but robot and bodies.

    `middle` is the middle of the ground in world [m], shape ``(2,)``.
    """

    def __init__(self, camera: Camera, middle: NDArray[np.float64]) -> None:
        self.camera = camera
        self.size = (round(_WIDTH * _FINER), round(_HEIGHT * _FINER))
        self._empty = images.new("RGB", self.size, _SKY)
        pen = drawing.Draw(self._empty)
        reach = 2.5 * float(np.linalg.norm(camera.eye[:2] - middle))
        pen.rectangle((0, camera.horizon * self.size[1], *self.size), fill=_GROUND)
        across = np.linspace(-reach, reach, 200)
        for at in np.arange(-(reach // _GRID_M), reach // _GRID_M + 1) * _GRID_M:
            along = np.full_like(across, at)
            for x, y in ((along, across), (across, along)):
                line = np.column_stack([x, y, np.zeros_like(x)])
                line[:, :2] += np.round(middle / _GRID_M) * _GRID_M
                # Points behind the camera are left out, because they would be projected upside down into the picture.
                pen.line(self._find_pixels(line[camera.faces(line)]), fill=_LINE, width=1)

    def _find_pixels(self, points: NDArray[np.float64]) -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in self.camera.project(points) * self.size]

    def picture(self) -> Any:
        """A picture of the ground alone."""
        return self._empty.copy()

    def paste(self, picture: Any, renderer: Renderer) -> None:
        """Draw robot and bodies, as they are in a renderer."""
        camera = self.camera
        seen = renderer.draw(*self.size, view=camera.view, projection=camera.projection, light=_LIGHT)
        # The picture of the robot is its own mask, because it is transparent where nothing was drawn.
        body = images.fromarray(seen)
        picture.paste(body, (0, 0), body)

    def mark(
        self, picture: Any, path: NDArray[np.float64], left: int, end: NDArray[np.float64] | None, colour: str
    ) -> None:
        """Draw a path of the object's centre in world [m], shape ``(n, 3)``, and a cross where it ended.

        It left the tool with the sample of number `left`, and is drawn in this colour from there on.
        """
        pen = drawing.Draw(picture)
        for part, color in ((path[: left + 1], _HELD), (path[left:], colour)):
            if len(part) > 1:
                pen.line(self._find_pixels(part), fill=color, width=3, joint="curve")
        if end is not None:
            for step in (np.array([0.1, 0.1, 0.0]), np.array([0.1, -0.1, 0.0])):
                pen.line(self._find_pixels(np.stack([end - step, end + step])), fill=colour, width=3)

    def shade(self, picture: Any, place: NDArray[np.float64]) -> None:
        """Draw the shadow of the object on the ground."""
        ((x, y),) = self._find_pixels(place[np.newaxis] * [1, 1, 0])
        drawing.Draw(picture).ellipse((x - 9, y - 3, x + 9, y + 3), fill=_LINE)


class Still:
    """Draws single pictures of a world of a configuration, from one place, with the ground."""

    def __init__(self, config: Config) -> None:
        self._joints = robot_of(config).joints
        self._renderer = _open_renderer(config)
        self._ground: Ground | None = None

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.__exit__()

    def draw(self, samples: Samples) -> NDArray[np.uint8]:
        """Draw the first sample, shape ``(400, 640, 3)``; the first call chooses the place of the camera."""
        place(self._renderer, self._joints, samples, 0)
        if self._ground is None:
            frames = np.array(self._renderer.find_frames())
            # A throw ends some two metres in front of the robot.
            front = np.add(samples.object_position, (2.0, 0.0, 0.5))
            points = np.concatenate([frames - _ROOM_M, frames + _ROOM_M, front, np.zeros((1, 3)), [[2.0, 0.0, 0.0]]])
            points[:, 2] = np.maximum(points[:, 2], 0)
            self._ground = Ground(camera_on(points, _WIDTH / _HEIGHT), points[:, :2].mean(axis=0))
        picture = self._ground.picture()
        self._ground.paste(picture, self._renderer)
        return np.array(picture.resize((_WIDTH, _HEIGHT), images.Resampling.LANCZOS).convert("RGB"))


@dataclass(frozen=True)
class Camera:
    """A camera at a place that looks along a direction, upright.

    Attributes:
        eye: Where it is in world [m], shape ``(3,)``.
        axes: Unit vectors to the right, up and backwards in world, one a row.
        aspect: Width over height of its picture.
    """

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    aspect: float

    @property
    def view(self) -> list[float]:
        """Matrix from world to camera in the convention of OpenGL, column by column."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.axes
        matrix[:3, 3] = -self.axes @ self.eye
        return matrix.T.ravel().tolist()

    @property
    def projection(self) -> list[float]:
        """Matrix from camera to clip space in the convention of OpenGL, column by column."""
        matrix = np.zeros((4, 4))
        matrix[0, 0], matrix[1, 1] = 1 / (_TANGENT * self.aspect), 1 / _TANGENT
        matrix[2, 2] = (_FAR_M + _NEAR_M) / (_NEAR_M - _FAR_M)
        matrix[2, 3] = 2 * _FAR_M * _NEAR_M / (_NEAR_M - _FAR_M)
        matrix[3, 2] = -1
        return matrix.T.ravel().tolist()

    @property
    def horizon(self) -> float:
        """Share of its picture's height, from the top, at which level ground ends."""
        return float(1 - self.axes[2, 2] / (self.axes[1, 2] * _TANGENT)) / 2

    def faces(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Find out which points, in world [m], shape ``(n, 3)``, are well in front of the camera, shape ``(n,)``."""
        distance: NDArray[np.float64] = (self.eye - points) @ self.axes[2]
        return distance > _NEAREST_M

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Find the places of points in the picture, which are in world [m] in front of the camera, shape ``(n, 3)``.

        Places are shares of its width from the left and of its height from the top, shape ``(n, 2)``.
        """
        seen = (points - self.eye) @ self.axes.T
        right, up = seen[:, 0] / (-seen[:, 2] * _TANGENT * self.aspect), seen[:, 1] / (-seen[:, 2] * _TANGENT)
        return np.stack([(1 + right) / 2, (1 - up) / 2], axis=1)


def camera_on(points: NDArray[np.float64], aspect: float, heading: float = 0.0) -> Camera:
    """Place the camera as near as possible with all points in its picture, on the right of a throw.

    The points are in world [m], shape ``(n, 3)``; the aspect is width over height of the picture; the heading is the
    angle from x to the direction of the throw [rad].
    """
    cos, sin = np.cos(heading), np.sin(heading)
    back = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ _OUTWARD / np.linalg.norm(_OUTWARD)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    # From here on the places are in the frame of the camera, whose third axis points backwards.
    axes = np.stack([right, np.cross(back, right), back])
    seen = points @ axes.T
    # A point is in the picture if its distance from the axis is below the tangent times its distance along the axis.
    place = np.empty(3)
    needed = []
    for axis, tangent in ((0, _TANGENT * aspect), (1, _TANGENT)):
        slope = tangent * (1 - 2 * _MARGIN)
        upper, lower = np.max(seen[:, axis] + slope * seen[:, 2]), np.max(-seen[:, axis] + slope * seen[:, 2])
        # The two outermost lines of this slope, one on each side, meet at the nearest place that sees all points.
        place[axis] = (upper - lower) / 2
        needed.append((upper + lower) / (2 * slope))
    place[2] = max(needed)
    return Camera(place @ axes, axes, aspect)
