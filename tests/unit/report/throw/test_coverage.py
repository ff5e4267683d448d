"""Coverage of the plane by landings."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from throwcollect.config.sweep import TargetConfig
from throwcollect.report.throw.measured import CellAxis, Landings, count_throws
from throwcollect.report.throw.throw_figures import draw_coverage_map


def make_landings(distance: list[float], angle: list[float]) -> Landings:
    count, zero = len(distance), np.zeros(len(distance))
    trials = np.arange(count)
    return Landings(
        trials, trials, np.array(distance), zero, zero, trials * 0, np.array(distance), np.array(angle), zero
    )


def test_throws_are_counted_in_the_cells_of_the_configured_target() -> None:
    target = TargetConfig.model_validate(
        {
            "distance_m": {"min": 1, "max": 2, "bins": 2},
            "height_m": {"min": 0, "max": 1, "bins": 2},
            "hit_angle_rad": {"min": 0, "max": 1, "bins": 1},
        }
    )
    throws = pa.table({"scene_landing_height_m": [0.2, 0.7, 1.0, 0.1]})
    found = count_throws(make_landings([1.2, 1.2, 2.0, 2.1], [0.5, 0.5, 1.0, 0.5]), throws, target=target)
    assert found is not None
    assert found.counts.tolist() == [[[1, 1]], [[0, 1]]]  # distance, hit angle, height
    assert (found.hit, found.throws, found.counts.size) == (3, 4, 4)
    assert [(first.label[:3], second.label[:3]) for first, second, _ in found.pairs] == [
        ("lan", "hit"),
        ("lan", "lan"),
        ("hit", "lan"),
    ]
    assert found.pairs[1][2].tolist() == [[1, 1], [0, 1]]
    assert found.pairs[2][2].tolist() == [[1, 2]]


def test_cells_have_round_edges_if_no_target_is_configured() -> None:
    found = count_throws(make_landings([1.0, 1.34, 2.4], [1.2, 1.21, 1.3]), pa.table({}), target=None)
    assert found is not None
    distance, angle = found.axes
    assert distance.edges == pytest.approx(np.arange(1.0, 2.5001 + 0.1, 0.1)[: len(distance.edges)])
    assert np.diff(angle.edges) == pytest.approx(0.5)
    assert found.counts.sum() == 3
    assert count_throws(make_landings([], []), pa.table({}), target=None) is None


@pytest.mark.parametrize(("most", "mark"), [(1, 1), (8, 1), (9, None)])
def test_the_colour_scale_begins_at_0_and_marks_only_whole_throws(most: int, mark: int | None) -> None:
    axis = CellAxis("landing distance", "landing distance [m]", np.array([1.0, 2.0]))
    (cells,) = draw_coverage_map(axis, axis, np.array([[most]])).data
    assert (cells.zmin, cells.zmax, cells.colorbar.dtick) == (0, most, mark)
