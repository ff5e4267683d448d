"""Draws stored throws as pictures, animated pictures and videos: one throw, or several side by side."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.sensors import PictureConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.extras import lazily, require
from throwcollect.files import write_file
from throwcollect.progress_log import log_progress
from throwcollect.publish.view.throw_pictures import FINE, SIZE, DrawnThrow, camera_for
from throwcollect.publish.view.viewer_directory import choose_throws
from throwcollect.sensing.camera import Camera
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.sensor import CameraSensor, make_sensor

images = lazily("PIL.Image")
drawing = lazily("PIL.ImageDraw")
fonts = lazily("PIL.ImageFont")
av = lazily("av")

Picture = NDArray[np.uint8]
"""Red, green and blue, shape ``(height, width, 3)``."""

_KINDS = (".webp", ".gif", ".mp4", ".png")
_FRAME_MS = 50
_LAST_FRAME_MS = 1200
_MOST_THROWS = 64
_GAP = 2
_INK, _PAPER = (60, 66, 74), (255, 255, 255)


@dataclass(frozen=True)
class Rendering:
    """A file with pictures of throws that was written.

    Attributes:
        file: The file.
        trials: Numbers of the trials in it.
        pictures: Number of pictures, one after another.
        duration_s: How long it moves [s], without the time of the last picture.
        size_bytes: Its size.
    """

    file: Path
    trials: tuple[int, ...]
    pictures: int
    duration_s: float
    size_bytes: int


def render(
    directory: Path,
    output: Path,
    *,
    trials: Iterable[int] | None = None,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    slow: float = 1.0,
) -> Rendering:
    """Draw throws of a dataset.

    Args:
        directory: The dataset.
        output: A ``.webp``, ``.gif``, ``.mp4`` or ``.png`` file, which is replaced if it exists. A PNG shows
            the end of the throws, all others show them from start to end.
        trials: Numbers of the trials, which begin at the same time, side by side; the first one that has an episode by
            default.
        camera: Name of a camera of the configuration, which draws what it sees; by default a place from which all of
            the throws can be seen, with the path of the object and where it ended.
        size: Width and height of the picture of a throw [pixels].
        slow: How many times slower than real time it is.
    """
    kind = output.suffix.lower()
    if kind not in _KINDS:
        raise ConfigError(f"{output}: no picture ends like this", expected=f"a name with {' or '.join(_KINDS)}")
    require("PIL", *(("av",) if kind == ".mp4" else ()))
    dataset = Dataset.open(directory)
    chosen = choose_throws(dataset, trials)
    if trials is None:
        chosen = chosen[:1]
    if len(chosen) > _MOST_THROWS:
        raise ConfigError(f"trials: {len(chosen)} throws", expected=f"at most {_MOST_THROWS} in one picture")
    throws, cameras = _prepare(chosen, camera, size)
    last_s = max(float(each.times_s[-1]) for each in throws)
    times = [last_s] if kind == ".png" else [*np.arange(0, last_s, _FRAME_MS / 1000 / slow), last_s]

    def draw(each: DrawnThrow, seen_by: Camera, time_s: float) -> Picture:
        words = f"{each.throw.trial}: {each.throw.outcome.replace('_', ' ')}" if len(throws) > 1 else ""
        return _label(each.draw(seen_by, time_s, marks=camera is None), words)

    pictures = [
        _arrange([draw(each, seen_by, time_s) for each, seen_by in zip(throws, cameras, strict=True)])
        for time_s in log_progress(times, len(times), "picture", "drawn")
    ]
    data = _encode(kind, pictures)
    write_file(output, data)
    moves_s = (len(pictures) - 1) * _FRAME_MS / 1000
    return Rendering(output, tuple(each.throw.trial for each in throws), len(times), moves_s, len(data))


def _prepare(
    chosen: Dataset, camera: str | None, size: tuple[int, int] | None
) -> tuple[list[DrawnThrow], list[Camera]]:
    """Read throws, and place a camera for each."""
    own, recorded = chosen.config, chosen.robot_description()
    throws, cameras = [], []
    for throw in chosen:
        config = throw.config
        # The recorded description has the tool of the configuration; a tool that is swept is described anew.
        scene = Scene.of(config, description=recorded if config.tool == own.tool else None, triangles=FINE)
        throws.append(DrawnThrow(throw, config, scene))
        if camera is not None:
            sections = {name: each for name, each in config.sensors.items() if isinstance(each, PictureConfig)}
            if camera not in sections:
                raise ConfigError(f"camera: there is no camera {camera}", expected=" or ".join(sections) or "none")
            sensor = make_sensor(camera, config, scene, throw.trial)
            assert isinstance(sensor, CameraSensor)  # noqa: S101 - its section takes pictures
            width, height = size or (sensor.camera.width, sensor.camera.height)
            cameras.append(replace(sensor.camera, width=width, height=height, smooth=True))
    if camera is None:
        size = size or (SIZE if len(throws) == 1 else (SIZE[0] // 2, SIZE[1] // 2))
        cameras = [camera_for(throws, size)] * len(throws)
    return throws, cameras


def _label(picture: Picture, words: str) -> Picture:
    """Write words into the upper left corner of a picture."""
    if not words:
        return picture
    image = images.fromarray(picture)
    drawing.Draw(image).text((6, 4), words, _INK, fonts.load_default(max(11, image.width // 26)))
    return np.asarray(image)


def _arrange(pictures: Sequence[Picture]) -> Picture:
    """Put pictures of one size side by side, in about as many rows as columns, with lines between them."""
    if len(pictures) == 1:
        return pictures[0]
    (height, width, _), columns = pictures[0].shape, math.ceil(math.sqrt(len(pictures)))
    rows = -(-len(pictures) // columns)
    sheet = np.full((rows * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, 3), _PAPER, np.uint8)
    for number, picture in enumerate(pictures):
        y, x = (place * (length + _GAP) for place, length in zip(divmod(number, columns), (height, width), strict=True))
        sheet[y : y + height, x : x + width] = picture
    return sheet


def _encode(kind: str, pictures: Sequence[Picture]) -> bytes:
    """Encode pictures as a file of a kind, such as ``.gif``."""
    if kind == ".mp4":
        return _encode_video(pictures)
    shown = [images.fromarray(picture) for picture in pictures]
    times = [_FRAME_MS] * (len(shown) - 1) + [_LAST_FRAME_MS]
    moving = {"save_all": True, "append_images": shown[1:], "duration": times, "loop": 0, "quality": 80, "method": 4}
    buffer = io.BytesIO()
    shown[0].save(buffer, kind[1:].upper(), **({"optimize": True} if kind == ".png" else moving))
    return buffer.getvalue()


def _encode_video(pictures: Sequence[Picture]) -> bytes:
    """Encode H.264, which all browsers and players show; the last picture stays for a while."""
    # Colors have half the resolution, so that height and width must be even.
    height, width = (length - length % 2 for length in pictures[0].shape[:2])
    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=1000 // _FRAME_MS, options={"crf": "18"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for picture in [*pictures, *[pictures[-1]] * (_LAST_FRAME_MS // _FRAME_MS)]:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return buffer.getvalue()
