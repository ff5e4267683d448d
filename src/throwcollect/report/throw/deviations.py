"""A picture of the distances between landings by two engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from throwcollect.report.contents import Panel
from throwcollect.report.figures import BLUE, NEUTRAL
from throwcollect.report.painter import paint


def write_deviations(deviations: Sequence[Sequence[float]], path: Path) -> None:
    """Draw the landings by one engine relative to those by another one.

    Args:
        deviations: Differences of each throw's landings along x and along y [m], shape ``(2, n_throws)``.
        path: PNG file to write.

    Raises:
        OSError: If it cannot be written.
    """
    x, y = 1e3 * np.array(deviations)
    figure = go.Figure(go.Scatter(x=x, y=y, mode="markers", marker={"color": BLUE, "size": 4, "symbol": "circle"}))
    figure.add_hline(y=0, line={"color": NEUTRAL, "width": 1})
    figure.add_vline(x=0, line={"color": NEUTRAL, "width": 1})
    figure.update_xaxes(title="landing farther in x by [mm]")
    figure.update_yaxes(title="landing farther in y by [mm]")
    figure.update_layout(height=400, showlegend=False)
    paint([Panel("deviations", "", figure)], path)
