"""The median of misses, and the miss that nine of ten stay below."""

from __future__ import annotations

import numpy as np
import pytest

from throwcollect.dataset.misses import find_median, find_share90


def test_the_median_of_an_even_number_of_misses_is_the_mean_of_the_middle_two() -> None:
    assert find_median([0.1, 0.01, 0.03, 0.02]) == pytest.approx(0.025)
    assert find_median([0.3, 0.1, 0.2]) == 0.2


@pytest.mark.parametrize("count", [1, 2, 4, 10, 11, 31, 40])
def test_the_miss_that_nine_of_ten_stay_below_is_the_linear_quantile(count: int) -> None:
    misses = np.random.default_rng(count).uniform(0, 1, count)
    assert find_share90(misses) == pytest.approx(np.quantile(misses, 0.9))


def test_a_throw_that_did_not_succeed_counts_as_farther_than_all_others() -> None:
    assert find_median([0.3, np.inf, 0.1]) == 0.3
    assert find_median([0.3, np.inf, 0.1, np.inf]) is None
    eleven = [*np.arange(10) / 10, np.inf]
    assert find_share90(eleven) == 0.9
    assert find_share90(eleven[1:]) is None
    assert find_share90([np.inf, np.inf]) is None


def test_no_misses_have_no_median() -> None:
    assert (find_median([]), find_share90([])) == (None, None)
