"""Coverage of the plane by landings."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from throwcollect.config.sweep import TargetConfig
from throwcollect.report.figures import Points
from throwcollect.report.throw.throw_sections import CellAxis, _show_cells, count_throws, draw_coverage_map


def make_landings(distance: list[float]) -> Points:
    trials, zero = np.arange(len(distance)), np.zeros(len(distance))
    return Points(trials, trials, np.array(distance), zero, np.array(distance), zero, trials * 0)


def test_throws_are_counted_in_the_cells_of_the_configured_target() -> None:
    target = TargetConfig.model_validate(
        {
            "distance_m": {"min": 1, "max": 2, "bins": 2},
            "height_m": {"min": 0, "max": 1, "bins": 2},
            "hit_angle_rad": {"min": 0, "max": 1, "bins": 1},
        }
    )
    throws = pa.table({"scene_landing_height_m": [0.2, 0.7, 1.0, 0.1], "hit_angle_rad": [0.5, 0.5, 1.0, 0.5]})
    found = count_throws(make_landings([1.2, 1.2, 2.0, 2.1]), throws, target=target)
    assert found is not None
    assert found.counts.tolist() == [[[1, 1]], [[0, 1]]]  # distance, hit angle, height
    assert found.others == 1
    panels = {panel.title: panel for panel in _show_cells(found, "landed")}
    assert list(panels) == [
        "Targets: landing distance and hit angle",
        "Targets: landing distance and landing height",
        "Targets: hit angle and landing height",
    ]
    first, second, third = (np.nan_to_num(panel.figure.data[0].z).T.tolist() for panel in panels.values())
    assert (first, second, third) == ([[2], [1]], [[1, 1], [0, 1]], [[1, 2]])
    text = panels["Targets: landing distance and hit angle"].text
    assert text == "3 of 4 cells have a throw that landed, at most 1; 1 landed in no cell."


def test_cells_have_round_edges_if_no_target_is_configured() -> None:
    found = count_throws(make_landings([1.0, 1.34, 2.4]), pa.table({"hit_angle_rad": [1.2, 1.21, 1.3]}), target=None)
    assert found is not None
    distance, angle = found.axes
    assert distance.edges == pytest.approx(np.arange(1.0, 2.5001 + 0.1, 0.1)[: len(distance.edges)])
    assert np.diff(angle.edges) == pytest.approx(0.5)
    assert found.counts.sum() == 3
    assert count_throws(make_landings([]), pa.table({}), target=None) is None


@pytest.mark.parametrize(("most", "mark"), [(1, 1), (8, 1), (9, None)])
def test_the_colour_scale_begins_at_0_and_marks_only_whole_throws(most: int, mark: int | None) -> None:
    axis = CellAxis("landing distance", "landing distance [m]", np.array([1.0, 2.0]))
    (cells,) = draw_coverage_map(axis, axis, np.array([[most]])).data
    assert (cells.zmin, cells.zmax, cells.colorbar.dtick) == (0, most, mark)
