"""Moments of the rows of tables that come in pieces."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest

from throwcollect.dataset.derive.statistics import Moments


def test_moments_of_portions_add_up_to_those_of_the_whole() -> None:
    rows = np.random.default_rng(0).normal(1e3, [1.0, 1e-3, 0.0], size=(1000, 3))
    moments = reduce(Moments.with_more, map(Moments.of, np.split(rows, [1, 5, 700])))
    assert moments.count == 1000
    assert moments.minimum.tolist() == rows.min(axis=0).tolist()
    assert moments.maximum.tolist() == rows.max(axis=0).tolist()
    assert moments.mean == pytest.approx(rows.mean(axis=0), rel=1e-14)
    assert moments.std == pytest.approx(rows.std(axis=0), rel=1e-9, abs=1e-12)


def test_moments_do_not_depend_on_the_layout_in_memory() -> None:
    rows = np.random.default_rng(0).normal(1e3, [1.0, 1e-3], size=(1000, 2))
    moments, others = Moments.of(rows), Moments.of(np.asfortranarray(rows))
    assert others.mean.tolist() == moments.mean.tolist()
    assert others.squares.tolist() == moments.squares.tolist()
