"""A picture of the distances between landings by two engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from throwcollect.errors import ConfigError
from throwcollect.files import unwritable
from throwcollect.report.contents import Panel
from throwcollect.report.figures import BLUE, LEGEND_ABOVE, LIMIT_LINE, NEUTRAL
from throwcollect.report.painter import paint
from throwcollect.wording import format_count

_CORNERS = 73
"""Corners of the polygon that is drawn for a circle."""


def check_picture(path: Path) -> None:
    """Check that a picture can be written to a new file of this name, before throws are simulated for it."""
    if path.suffix.lower() != ".png":
        raise ConfigError(f"{path}: should end with .png, as that is what is written")
    if path.exists():
        raise ConfigError(f"{path}: exists", expected="a file that is new")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: its directory does not exist", expected="a file in one that does")


def write_deviations(deviations: Sequence[Sequence[float]], engine: str, path: Path) -> None:
    """Draw the landings by an engine relative to the stored ones, into a PNG file.

    Args:
        deviations: Differences of each throw's landings along x and along y [m], shape ``(2, n_throws)``.
        engine: Name of the engine.
        path: The file.
    """
    x, y = 1e3 * np.array(deviations)
    rms = float(np.sqrt((x**2 + y**2).mean()))
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS)
    points = {"color": BLUE, "size": 4, "symbol": "circle"}
    middle = {"color": LIMIT_LINE["color"], "size": 9, "symbol": "cross"}
    figure = go.Figure(
        [
            go.Scatter(x=x, y=y, mode="markers", marker=points, name=format_count(len(x), "throw")),
            go.Scatter(x=[x.mean()], y=[y.mean()], mode="markers", marker=middle, name="mean"),
            go.Scatter(
                x=rms * np.cos(angle),
                y=rms * np.sin(angle),
                mode="lines",
                line=LIMIT_LINE,
                name=f"root mean square, {rms:.3g} mm",
            ),
        ]
    )
    figure.add_hline(y=0, line={"color": NEUTRAL, "width": 1})
    figure.add_vline(x=0, line={"color": NEUTRAL, "width": 1})
    figure.update_xaxes(title=f"landing by {engine}, farther in x than stored by [mm]")
    # Both axes have the same scale, so that the shape of the cloud shows in which direction engines differ.
    figure.update_yaxes(title="farther in y by [mm]", scaleanchor="x", constrain="domain")
    figure.update_layout(height=400, legend=LEGEND_ABOVE)
    try:
        paint([Panel("deviations", "", figure)], path)
    except OSError as error:
        raise unwritable(path, error) from error
