"""A picture of the distances between landings by two engines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from matplotlib.backends.backend_agg import FigureCanvasAgg

from throwcollect.errors import ConfigError
from throwcollect.files import unwritable
from throwcollect.report.contents import Panel
from throwcollect.report.figures import BLUE, NEUTRAL
from throwcollect.report.painter import paint


def write_deviations(deviations: Sequence[Sequence[float]], path: Path) -> None:
    """Draw the landings by one engine relative to those by another one, into a PNG file.

    The differences of each throw's landings along x and along y [m] have the shape ``(2, n_throws)``.

    Raises:
        ConfigError: If the name of the file ends with that of something else than a picture.
        DatasetError: If the file cannot be written.
    """
    if path.suffix and path.suffix.lower()[1:] not in FigureCanvasAgg.get_supported_filetypes():
        raise ConfigError(f"{path}: no picture ends like this", expected="a name with .png")
    x, y = 1e3 * np.array(deviations)
    figure = go.Figure(go.Scatter(x=x, y=y, mode="markers", marker={"color": BLUE, "size": 4, "symbol": "circle"}))
    figure.add_hline(y=0, line={"color": NEUTRAL, "width": 1})
    figure.add_vline(x=0, line={"color": NEUTRAL, "width": 1})
    figure.update_xaxes(title="landing farther in x by [mm]")
    figure.update_yaxes(title="landing farther in y by [mm]")
    figure.update_layout(height=400, showlegend=False)
    try:
        paint([Panel("deviations", "", figure)], path)
    except OSError as error:
        raise unwritable(path, error) from error
