"""Noise of sensors that follows from names and numbers alone, with the same bits everywhere."""

from __future__ import annotations

import hashlib
from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.sensors import CameraNoise, LidarNoise

_BITS = 12


class Noise:
    """Noise of one stream of a sensor.

    Args:
        noise: How much there is.
        seed: Seed of the collection.
        trial: Number of the trial.
        stream: Name of the sensor and its stream.
    """

    def __init__(self, noise: CameraNoise | LidarNoise, seed: int, trial: int, stream: str) -> None:
        self._noise, self._name = noise, f"{seed}/{trial}/{stream}"

    def color(self, picture: NDArray[np.uint8], frame: int) -> NDArray[np.uint8]:
        """Disturb colors of any shape; `frame` is the number of the frame."""
        if not isinstance(self._noise, CameraNoise) or not self._noise.color_std:
            return picture
        sum_ = picture + np.float32(self._noise.color_std) * self._draw_normal(frame, picture.shape)
        return np.clip(np.rint(sum_), 0, 255).astype(np.uint8)

    def distance(self, distance_m: NDArray[np.float32], frame: int) -> NDArray[np.float32]:
        """Disturb depths or ranges of any shape; none gets below zero, and where one is dropped, it is NaN."""
        noise, std_share = self._noise, 0.0
        if isinstance(noise, CameraNoise):
            std_m, std_share = noise.depth_std_m, noise.depth_std_share
        else:
            std_m = noise.range_std_m
        if std_m or std_share:
            spread = np.float32(std_m) + np.float32(std_share) * np.where(np.isfinite(distance_m), distance_m, 0)
            disturbed = distance_m + spread * self._draw_normal(frame, distance_m.shape)
            distance_m = np.where(np.isfinite(distance_m), np.maximum(disturbed, np.float32(0)), distance_m)
        if self._noise.dropout:
            dropped = self._draw(f"{frame}/dropout", distance_m.shape) < round(self._noise.dropout * 2**16)
            distance_m = np.where(dropped, np.float32(np.nan), distance_m)
        return distance_m

    def _draw_normal(self, frame: int, shape: tuple[int, ...]) -> NDArray[np.float32]:
        normal: NDArray[np.float32] = _list_normal()[self._draw(str(frame), shape) >> (16 - _BITS)]
        return normal

    def _draw(self, name: str, shape: tuple[int, ...]) -> NDArray[np.uint16]:
        """Draw numbers of 16 bits."""
        key = int.from_bytes(hashlib.sha256(f"{self._name}/{name}".encode()).digest()[:16], "little")
        count = int(np.prod(shape))
        # The raw output of Philox is fixed; what NumPy's generators make of it may change with their version.
        raw = np.random.Philox(key=key).random_raw(-(-count // 4)).astype("<u8")
        return raw.view("<u2")[:count].reshape(shape)


@cache
def _list_normal() -> NDArray[np.float32]:
    """List values of a standard normal distribution that are all equally likely."""
    # Rounded, so that the last bits of a logarithm do not matter.
    return np.array([round(NormalDist().inv_cdf((step + 0.5) / 2**_BITS), 6) for step in range(2**_BITS)], np.float32)
