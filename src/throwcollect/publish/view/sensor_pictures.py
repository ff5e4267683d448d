"""Frames of sensors as PNG files: colors, depths in millimetres, labels, and points of lidars from above."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.sensors import LayersConfig, LidarConfig, PictureConfig
from throwcollect.dataset.sensors import SensorFrames
from throwcollect.extras import lazily, require
from throwcollect.files import new_directory

images = lazily("PIL.Image")
_SIZE = 480
"""Width and height of a picture of points [pixels]."""


def write_first_frames(sensors: Mapping[str, SensorFrames], output: Path) -> None:
    """Write the first frame of each sensor, a file for each stream, into a new directory."""
    require("PIL")
    with new_directory(output) as directory:
        for name, sensor in sensors.items():
            for stream, picture in _draw(sensor, 0):
                images.fromarray(picture).save(directory / f"{name}_{stream}.png")


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
