"""Polynomials of several inputs."""

import numpy as np
import pytest

from throwcollect.learning.polynomial import cross_validate, fit_polynomial, list_exponents


def cubic(inputs):
    x, y = inputs.T
    return np.stack([1 + 2 * x - y + x * y**2 - 0.5 * x**3, 0.3 * y**3 - x], axis=1)


@pytest.fixture
def inputs():
    return np.random.default_rng(0).random((80, 2)) * 2 - 1


def test_fitting_samples_of_a_cubic_finds_the_cubic(inputs):
    found = fit_polynomial(inputs, cubic(inputs), 3)
    assert found.exponents.sum(axis=1).max() == 3
    elsewhere = np.random.default_rng(1).random((20, 2)) * 2 - 1
    assert found.predict(elsewhere) == pytest.approx(cubic(elsewhere), abs=1e-5)


def test_slopes_agree_with_finite_differences(inputs):
    found = fit_polynomial(inputs, cubic(inputs), 4)
    slopes = found.slopes(inputs, slice(None))
    assert slopes.shape == (80, 2, 2)
    for column in range(2):
        step = np.zeros(2)
        step[column] = 1e-5
        difference = (found.predict(inputs + step) - found.predict(inputs - step)) / 2e-5
        assert slopes[:, :, column] == pytest.approx(difference, abs=1e-7)


def test_cross_validation_chooses_the_degree_that_predicts_best(inputs):
    noise = 0.01 * np.random.default_rng(2).standard_normal((80, 2))
    found = cross_validate(inputs, cubic(inputs) + noise, np.arange(80) % 5)
    medians = {degree: np.median(errors) for degree, errors in found.items()}
    assert min(medians, key=medians.__getitem__) == 3
    assert medians[3] < 0.03 < medians[2]


def test_a_degree_with_too_many_terms_for_the_samples_is_not_tried(inputs):
    few = inputs[:12]
    assert list(cross_validate(few, cubic(few), np.arange(12) % 5)) == [1, 2]


def test_cross_validation_predicts_a_sample_only_from_others(inputs):
    outputs = cubic(inputs)
    outputs[0] += 5.0
    found = cross_validate(inputs, outputs, np.arange(80) % 5)
    assert found[3][0] == pytest.approx(5 * np.sqrt(2), rel=0.2)


def test_the_exponents_cover_all_terms_up_to_the_degree():
    assert list_exponents(5, 3).shape == (56, 5)
    assert list_exponents(2, 1).tolist() == [[0, 0], [1, 0], [0, 1]]


def test_minor_inputs_are_at_most_linear_in_terms_of_high_degree():
    rows = list_exponents(3, 3, minor=2)
    assert [0, 1, 1] in rows.tolist()
    high = rows[rows.sum(axis=1) > 2]
    assert high[:, 1:].sum(axis=1).max() == 1
    assert {tuple(row) for row in high.tolist()} == {(3, 0, 0), (2, 1, 0), (2, 0, 1)}
    assert list_exponents(15, 3, minor=10).shape == (321, 15)
