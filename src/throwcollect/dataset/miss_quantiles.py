"""The numbers that sum up misses: their median, and the miss that nine of ten stay below.

They are in one place so that misses of a dataset and those of a model, which stand side by side, can be compared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def find_median(misses: Sequence[float] | NDArray[np.float64]) -> float | None:
    """Find the median; of an even number of misses, the mean of the middle two.

    Args:
        misses: Distances in any order; infinite for a trial that did not succeed, which so counts as farther than all.

    Returns:
        The median; None without misses, and where it depends on a trial that did not succeed.
    """
    median = float(np.median(misses)) if len(misses) else np.inf
    return median if np.isfinite(median) else None


def find_share90(misses: Sequence[float] | NDArray[np.float64]) -> float | None:
    """Find the miss that nine of ten stay below, linear between the two misses that are nearest to it in order.

    Arguments and result are as those of `find_median`.
    """
    if not len(misses):
        return None
    ordered = np.sort(np.asarray(misses, np.float64))
    farthest = ordered[-(-9 * (len(ordered) - 1) // 10)]
    # Larger misses do not count, but numpy would multiply the next one by 0, which is not a number if it is infinite.
    return float(np.quantile(np.minimum(ordered, farthest), 0.9)) if np.isfinite(farthest) else None
