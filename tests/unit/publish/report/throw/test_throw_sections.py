from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from throwcollect.config.sweep import TargetConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.publish.report.figures import Points
from throwcollect.publish.report.measured import Outcomes
from throwcollect.publish.report.throw.throw_sections import (
    _show_cells,
    count_throws,
    report_throws,
)
from throwcollect.tasks.outcome_styles import style_of
from throwcollect.tasks.throw_into.into_result import IntoOutcome


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
    landings = make_landings([1.2, 1.2, 2.0, 2.1])
    _, counts = count_throws(landings, throws, target=target)
    assert counts.tolist() == [[[1, 1]], [[0, 1]]]  # distance, hit angle, height
    panels = {panel.title: panel for panel in _show_cells(landings, throws, target, "landed")}
    assert list(panels) == [
        "Targets: landing distance and hit angle",
        "Targets: landing distance and landing height",
        "Targets: hit angle and landing height",
    ]
    first, second, third = (np.nan_to_num(panel.figure.data[0].z).T.tolist() for panel in panels.values())
    assert (first, second, third) == ([[2], [1]], [[1, 1], [0, 1]], [[1, 2]])
    text = panels["Targets: landing distance and hit angle"].text
    assert text == "3 of 4 cells have a throw that landed, at most 1; 1 landed in no cell."


def rest_in_bin(samples: Samples, header: EpisodeHeader) -> tuple[Samples, EpisodeHeader]:
    """The balls of even trials rest in the bin."""
    if header.trial % 2:
        return samples, header
    samples.object_position[-1], samples.object_linear_velocity[-1] = (1.6, -0.25, 0.05), 0.0
    return samples, replace(header, end_reason="rest")


def test_a_report_on_throws_into_a_bin_shows_the_bin_and_which_throws_stayed_in_it(
    make_collection: Any, tmp_path: Path
) -> None:
    swept = {"task.bin.y_m": {"values": [-0.2, -0.3, 9.0]}, "task.duration_s": {"values": [0.9, 1.0]}}
    pole = {"shape": "cylinder", "position_m": [1, 2, 0.5], "radius_m": 0.1, "length_m": 1, "color": "#3f6fb0"}
    settings = {
        "trials": None,
        "task": {"name": "throw_into"},
        "scene": {"bodies": {"pole": pole}},
        "sweep": {"sampler": "grid", "parameters": swept},
    }
    dataset = Dataset.open(make_collection(settings).collect(tmp_path / "a", change=rest_in_bin))
    outcomes = Outcomes.of(dataset["outcome"].tolist(), list(IntoOutcome))
    assert outcomes.counts["in_bin"] == 2
    report = report_throws(dataset, outcomes)
    assert [label for _, label in report.tiles] == ["landing distance", "release speed"]
    landing, *_ = report.sections
    assert landing.text.startswith("2 of 6 throws stayed in the bin; the balls crossed the plane of the rim, ")
    above, *_ = landing.blocks[0]
    assert above.text == "Bodies differ from throw to throw; those of a few throws are drawn."
    drawn = [trace for trace in above.figure.data if trace.fill == "toself"]
    # Outlines lie behind everything else.
    assert drawn == list(above.figure.data[: len(drawn)])
    assert [trace.name for trace in drawn].count("pole") == 1
    assert [trace.name for trace in drawn].count("bin_floor") == 3
    (pole_drawn,) = (trace for trace in drawn if trace.name == "pole")
    assert (max(pole_drawn.x), max(pole_drawn.y)) == pytest.approx((1.1, 2.1), abs=1e-3)
    assert pole_drawn.fillcolor == "rgba(63, 111, 176, 0.200)"
    legend = {trace.name: trace.marker.color for trace in above.figure.data if trace.showlegend is not False}
    assert legend["in bin"] == style_of("landed").colour
