from __future__ import annotations

from pathlib import Path

import matplotlib.image as image
import numpy as np
import plotly.graph_objects as go
import pytest

from throwcollect.report.contents import Panel
from throwcollect.report.painter import paint

RED = (1.0, 0.0, 0.0)


def find_red_pixels(figures: list[go.Figure], path: Path) -> np.ndarray:
    """Where something red was painted, shape ``(height, width)``."""
    panels = [
        Panel(f"panel-{number}", "title", figure, small=len(figures) > 1) for number, figure in enumerate(figures)
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("throwcollect.report.painter.DPI", 100)
        paint(panels, path)
    return np.asarray(np.abs(image.imread(path)[..., :3] - RED).max(axis=2) < 0.05)


def scatter(x: list[float], y: list[float], mode: str = "markers") -> go.Figure:
    figure = go.Figure().add_scatter(
        x=x,
        y=y,
        mode=mode,
        marker={"color": "#ff0000", "size": 20, "symbol": "circle"},
        line={"color": "#ff0000", "width": 6},
    )
    return figure.update_layout(height=400)


def centre(mask: np.ndarray) -> tuple[float, float]:
    rows, columns = np.nonzero(mask)
    return rows.mean() / len(mask), columns.mean() / len(mask[0])


def test_points_are_painted_where_their_axes_say(tmp_path: Path) -> None:
    figure = scatter([10.0], [1.0]).update_xaxes(type="log", range=[0, 2]).update_yaxes(range=[0, 10])
    down, across = centre(find_red_pixels([figure], tmp_path / "log.png"))
    assert across == pytest.approx(0.5, abs=0.1)  # 10 is half-way between 1 and 100
    assert down > 0.7  # 1 is near the lower end


def test_a_circle_is_painted_round_if_its_axes_share_a_scale(tmp_path: Path) -> None:
    angles = np.linspace(0, 2 * np.pi, 100)
    figure = scatter(np.cos(angles).tolist(), np.sin(angles).tolist(), "lines").update_yaxes(scaleanchor="x")
    rows, columns = np.nonzero(find_red_pixels([figure], tmp_path / "circle.png"))
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), abs=3)


def test_figures_of_one_picture_are_stacked_with_aligned_axes(tmp_path: Path) -> None:
    figures = [scatter([1.0, 2.0], [0.0, 0.0], "lines"), scatter([1.0, 2.0], [0.0, 0.0], "lines")]
    rows, columns = np.nonzero(find_red_pixels(figures, tmp_path / "stack.png"))
    first, second = rows[rows < rows.mean()], rows[rows > rows.mean()]
    assert second.min() - first.max() > 50
    ends = [(columns[part].min(), columns[part].max()) for part in (rows < rows.mean(), rows > rows.mean())]
    assert ends[0] == ends[1]


def test_subplots_are_painted_in_their_domains(tmp_path: Path) -> None:
    red, grey = "#ff0000", "#888888"
    figure = go.Figure(layout_height=400)
    for number, (left, bottom) in enumerate([(0, 0.5), (0.5, 0.5), (0, 0), (0.5, 0)], start=1):
        figure.add_bar(
            x=[1], y=[1], width=[1], marker_color=red if number == 2 else grey, xaxis=f"x{number}", yaxis=f"y{number}"
        )
        figure.update_layout(
            {f"xaxis{number}": {"domain": [left, left + 0.5]}, f"yaxis{number}": {"domain": [bottom, bottom + 0.5]}}
        )
    down, across = centre(find_red_pixels([figure], tmp_path / "grid.png"))
    assert down < 0.45
    assert across > 0.55


def test_the_legend_shows_line_and_markers_of_a_trace(tmp_path: Path) -> None:
    figure = scatter([1.0, 2.0], [0.0, 0.0], "lines+markers").update_traces(name="red")
    figure.add_scatter(x=[1.0], y=[1.0], mode="lines", line={"color": "#888888", "width": 2}, name="grey")
    rows, columns = np.nonzero(find_red_pixels([figure], tmp_path / "legend.png"))
    entry = rows < rows.max() / 3
    width = np.ptp(columns[entry])
    assert width > 1.2 * np.ptp(rows[entry])  # a dot alone is as high as it is wide
