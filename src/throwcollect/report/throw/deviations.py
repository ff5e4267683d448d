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


def check_picture(path: Path) -> None:
    """Check that a picture can be written to a new file of this name, before throws are simulated for it.

    Raises:
        ConfigError: If the name ends with that of something else than a picture, or is not new, or has no directory.
    """
    if path.suffix and path.suffix.lower()[1:] not in FigureCanvasAgg.get_supported_filetypes():
        raise ConfigError(f"{path}: no picture ends like this", expected="a name with .png")
    if path.exists():
        raise ConfigError(f"{path}: exists", expected="a file that is new")
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: its directory does not exist", expected="a file in one that does")


def write_deviations(deviations: Sequence[Sequence[float]], path: Path) -> None:
    """Draw the landings by one engine relative to those by another one, into a PNG file.

    The differences of each throw's landings along x and along y [m] have the shape ``(2, n_throws)``.

    Raises:
        DatasetError: If the file cannot be written.
    """
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
