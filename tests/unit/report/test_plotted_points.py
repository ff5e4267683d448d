from __future__ import annotations

import numpy as np

from throwcollect.report.plotted_points import choose_points


def test_the_chosen_points_are_reproducible_and_irregularly_spaced() -> None:
    assert choose_points(10, 20).tolist() == list(range(10))
    chosen = choose_points(100_000, 1000)
    assert np.array_equal(chosen, choose_points(100_000, 1000))
    assert len(set(chosen.tolist())) == 1000
    assert len(set(np.diff(chosen).tolist())) > 50
