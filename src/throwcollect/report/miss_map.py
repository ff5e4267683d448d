"""The figure of targets: where trials should end, and by how much they miss."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.report.figures import BLUE, LEGEND_ABOVE, LIMIT_LINE, NEUTRAL

ARROWS = 10
"""Misses are drawn so many times as long, unless they are large."""


def choose_scale(targets: NDArray[np.float64], places: NDArray[np.float64]) -> int:
    """How many times as long misses are drawn, so that the longest one stays about as short as the targets are apart.

    Args:
        targets: Shape ``(n_targets, 2)``, at least one.
        places: Where the trials at these targets ended, NaN where they did not, shape ``(n_targets, 2)``.
    """
    hit = np.isfinite(places).all(axis=1)
    longest = float(np.abs(places[hit] - targets[hit]).max(initial=0.0))
    return ARROWS if ARROWS * longest <= float(np.ptp(targets, axis=0).max()) or not longest else 1


def draw_miss_map(
    ends: NDArray[np.float64],
    targets: NDArray[np.float64],
    places: NDArray[np.float64],
    axes: tuple[str, str],
    *,
    times: int = ARROWS,
) -> go.Figure:
    """Draw targets amid where other trials ended, and a line for each miss.

    Args:
        ends: Where trials ended, shape ``(n, 2)``.
        targets: Shape ``(n_targets, 2)``.
        places: Where the trials at these targets ended, NaN where they did not, shape ``(n_targets, 2)``.
        axes: Titles of both axes.
        times: How many times as long misses are drawn.
    """
    figure = go.Figure()
    if len(ends):
        grey = {"color": NEUTRAL, "size": 3, "opacity": 0.5, "symbol": "circle"}
        figure.add_scatter(x=ends[:, 0], y=ends[:, 1], mode="markers", marker=grey, name="throws of the dataset")
    hit = np.isfinite(places).all(axis=1)
    for own, name, colour in ((hit, "targets", BLUE), (~hit, "targets where no throw landed", LIMIT_LINE["color"])):
        if own.any():
            marker = {"color": colour, "size": 7, "symbol": "cross"}
            figure.add_scatter(x=targets[own, 0], y=targets[own, 1], mode="markers", marker=marker, name=name)
    if hit.any():
        tips = targets[hit] + times * (places[hit] - targets[hit])
        x, y = (
            [
                each
                for pair in zip(targets[hit, axis].tolist(), tips[:, axis].tolist(), strict=True)
                for each in (*pair, None)
            ]
            for axis in (0, 1)
        )
        line = {"color": LIMIT_LINE["color"], "width": 1.5}
        figure.add_scatter(x=x, y=y, mode="lines", line=line, name=f"misses × {times}" if times > 1 else "misses")
    figure.update_xaxes(title=axes[0]).update_yaxes(title=axes[1], scaleanchor="x")
    return figure.update_layout(height=420, legend=LEGEND_ABOVE)
