"""Frames of sensors as PNG files: colors, depths in millimetres, labels, and points of lidars from above."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.sensors import LayersConfig, LidarConfig, PictureConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.errors import ConfigError
from throwcollect.extras import lazily, require
from throwcollect.files import new_directory
from throwcollect.publish.view.viewer_directory import choose_throws
from throwcollect.wording import suggest

images = lazily("PIL.Image")
_SIZE = 480
"""Width and height of a picture of points [pixels]."""


def write_images(directory: Path, output: Path, *, sensor: str, trials: Iterable[int] | None = None) -> int:
    """Write the frames of a sensor in some trials, or in all of them; returns the number of files."""
    dataset = Dataset.open(directory)
    if sensor not in dataset.config.sensors:
        raise ConfigError(f"--sensor: there is no sensor {sensor!r}{suggest(sensor, dataset.config.sensors)}")
    every = ((f"{sensor}_{throw.trial:06}", throw.sensors[sensor]) for throw in choose_throws(dataset, trials))
    return write_frames(
        ((f"{name}_{number:04}", frames, number) for name, frames in every for number in range(len(frames))), output
    )


def write_frames(frames: Iterable[tuple[str, SensorFrames, int]], output: Path) -> int:
    """Write frames, each with the beginning of its file names and its number, into a new directory."""
    require("PIL")
    count = 0
    with new_directory(output) as directory:
        for name, sensor, number in frames:
            for stream, picture in _draw(sensor, number):
                images.fromarray(picture).save(directory / f"{name}_{stream}.png")
                count += 1
    return count


def _draw(sensor: SensorFrames, number: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Draw each stream of a frame: pictures as they are, and points from above, with x upwards and y to the left."""
    if isinstance(sensor.config, PictureConfig):
        for stream in sensor.config.recorded:
            if stream == "depth":
                depth_mm = np.rint(sensor.depth_m[number] * 1000)
                yield stream, np.where((depth_mm > 0) & (depth_mm < 2**16), depth_mm, 0).astype(np.uint16)
            else:
                yield stream, (sensor.images if stream == "color" else sensor.labels)[number]
        return
    if isinstance(sensor.config, LayersConfig):
        name, (x, y) = "points", (sensor.points[number][axis].ravel() for axis in "xy")
    elif isinstance(sensor.config, LidarConfig):
        ranges, angles = sensor.ranges[number], np.array(sensor.config.angles_rad)
        ranges = np.where(np.isfinite(ranges), ranges, np.nan)
        name, (x, y) = "scan", (ranges * np.cos(angles), ranges * np.sin(angles))
    places = -np.stack([x, y])[:, np.isfinite(x)]
    row, column = (places * (0.48 * _SIZE / abs(places).max(initial=0.1)) + _SIZE / 2).astype(int)
    picture = np.full((_SIZE, _SIZE, 3), 255, np.uint8)
    for right, down in np.ndindex(3, 3):
        picture[row + down, column + right] = 40, 80, 160
    middle = slice(_SIZE // 2 - 3, _SIZE // 2 + 4)
    picture[middle, middle] = 220, 40, 40
    yield name, picture
