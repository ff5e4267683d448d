"""Statistics of features as LeRobot keeps them: of each episode, and of all frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

QUANTILES: Mapping[str, float] = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_BINS = 5000

Frames = NDArray[np.float64]
"""Values of one feature, shape ``(n_frames, n_components)``."""
Statistics = dict[str, NDArray[np.float64] | NDArray[np.int64]]
"""``min``, ``max``, ``mean``, ``std`` and quantiles of each component; ``count``, the number of frames."""


def of_episode(frames: Frames) -> Statistics:
    """Statistics of one episode, its quantiles exact."""
    quantiles = np.quantile(frames, list(QUANTILES.values()), axis=0)
    return {
        "min": frames.min(axis=0),
        "max": frames.max(axis=0),
        "mean": frames.mean(axis=0),
        "std": frames.std(axis=0),
        "count": np.array([len(frames)]),
        **dict(zip(QUANTILES, quantiles, strict=True)),
    }


@dataclass
class Moments:
    """What is known of all frames of a feature when they have passed by once.

    Attributes:
        count: Number of frames.
        minimum: Of each component.
        maximum: Of each component.
        mean: Of each component.
        squares: Sum of squared distances from the mean, of each component.
    """

    count: int
    minimum: NDArray[np.float64]
    maximum: NDArray[np.float64]
    mean: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def of(cls, frames: Frames) -> Moments:
        """Those of some frames."""
        mean = frames.mean(axis=0)
        return cls(len(frames), frames.min(axis=0), frames.max(axis=0), mean, ((frames - mean) ** 2).sum(axis=0))

    def with_more(self, more: Moments) -> Moments:
        """Those of both."""
        count = self.count + more.count
        step = more.mean - self.mean
        return Moments(
            count,
            np.minimum(self.minimum, more.minimum),
            np.maximum(self.maximum, more.maximum),
            self.mean + step * (more.count / count),
            self.squares + more.squares + step**2 * (self.count * more.count / count),
        )


def of_all(moments: Moments, passes: Iterable[Frames]) -> Statistics:
    """Statistics of all frames.

    Args:
        moments: Their moments.
        passes: The frames themselves once more, in any portions. Quantiles come from histograms of 5000 bins over the
            range of each component, so they are right to 1/5000 of it.
    """
    histogram = np.zeros((len(moments.minimum), _BINS), np.int64)
    span = moments.maximum - moments.minimum
    scale = np.divide(_BINS, span, out=np.zeros_like(span), where=span > 0)
    rows = np.arange(len(span)) * _BINS
    for frames in passes:
        bins = np.minimum(((frames - moments.minimum) * scale).astype(np.int64), _BINS - 1)
        histogram += np.bincount((bins + rows).ravel(), minlength=histogram.size).reshape(histogram.shape)
    below = np.cumsum(histogram, axis=1)
    quantiles = {}
    for name, share in QUANTILES.items():
        target = share * moments.count
        index = (below < target).sum(axis=1)
        inside = np.take_along_axis(histogram, index[:, np.newaxis], axis=1)[:, 0]
        before = np.take_along_axis(below, index[:, np.newaxis], axis=1)[:, 0] - inside
        quantiles[name] = moments.minimum + span * (index + (target - before) / inside) / _BINS
    return {
        "min": moments.minimum,
        "max": moments.maximum,
        "mean": moments.mean,
        "std": np.sqrt(moments.squares / moments.count),
        "count": np.array([moments.count]),
        **quantiles,
    }
