"""Statistics of features as LeRobot keeps them: of each episode, and of all frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from throwcollect.dataset.moments import Moments

QUANTILES: Mapping[str, float] = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_BINS = 5000

Frames = NDArray[np.float64]
"""Values of one feature, shape ``(n_frames, n_components)``."""
Statistics = dict[str, list[float] | list[int]]
"""``min``, ``max``, ``mean``, ``std`` and quantiles of each component; ``count``, the number of frames."""


def summarise_episode(frames: Frames) -> Statistics:
    """Compute the statistics of one episode, with exact quantiles."""
    return _list_statistics(Moments.of(frames), np.quantile(frames, list(QUANTILES.values()), axis=0))


def summarise_all(moments: Moments, portions: Iterable[Frames]) -> Statistics:
    """Compute the statistics of all frames from their moments and the frames themselves, in any portions.

    Quantiles come from histograms of 5000 bins over the range of each component, so they are right to 1/5000 of it.
    """
    low, span = moments.minimum, moments.maximum - moments.minimum
    histogram = np.zeros((len(span), _BINS), np.int64)
    # All values of a constant component are in the first bin.
    scale = np.divide(_BINS, span, out=np.zeros_like(span), where=span > 0)
    # Each component has numbers of bins of its own, so that one count serves all of them.
    rows = np.arange(len(span)) * _BINS
    for frames in portions:
        bins = np.minimum(((frames - low) * scale).astype(np.int64), _BINS - 1)
        histogram += np.bincount((bins + rows).ravel(), minlength=histogram.size).reshape(histogram.shape)
    below = np.cumsum(histogram, axis=1)
    quantiles = []
    for share in QUANTILES.values():
        target = share * moments.count
        # Within the bin that a quantile is in, values count as evenly spread.
        index = (below < target).sum(axis=1)[:, np.newaxis]
        inside = np.take_along_axis(histogram, index, axis=1)[:, 0]
        before = np.take_along_axis(below, index, axis=1)[:, 0] - inside
        quantiles.append(low + span * (index[:, 0] + (target - before) / inside) / _BINS)
    return _list_statistics(moments, np.array(quantiles))


def _list_statistics(moments: Moments, quantiles: Frames) -> Statistics:
    """List moments, and quantiles of shape ``(n_quantiles, n_components)``, by the names that LeRobot gives them."""
    return {
        "min": moments.minimum.tolist(),
        "max": moments.maximum.tolist(),
        "mean": moments.mean.tolist(),
        "std": moments.std.tolist(),
        "count": [moments.count],
        **dict(zip(QUANTILES, quantiles.tolist(), strict=True)),
    }
