"""Points of Sobol sequences, compared with those of SciPy."""

import math

import numpy as np
import pytest
from scipy.stats import qmc

from throwcollect.plan.samplers import draw_sobol


@pytest.mark.parametrize(("dimensions", "count"), [(1, 1), (1, 2), (2, 3), (5, 200), (40, 4096), (1024, 64)])
@pytest.mark.parametrize("seed", [0, 7])
def test_points_equal_those_of_scipy_bit_for_bit(dimensions, count, seed):
    randomness = np.random.default_rng(seed)
    # SciPy gives its sequences a generator of their own.
    points = draw_sobol(count, dimensions, randomness.spawn(1)[0])
    # SciPy warns of lengths that are no power of two, so a longer sequence is cut.
    expected = qmc.Sobol(dimensions, seed=np.random.default_rng(seed)).random_base2(math.ceil(math.log2(count)))
    np.testing.assert_array_equal(points, expected[:count])


def test_the_first_points_do_not_depend_on_how_many_follow():
    few, many = (draw_sobol(count, 3, np.random.default_rng(1)) for count in (5, 777))
    np.testing.assert_array_equal(few, many[:5])
