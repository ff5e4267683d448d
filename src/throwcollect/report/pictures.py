"""Pictures for papers: one column wide, sharp in print, drawn without a display."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from throwcollect.report import drawings
from throwcollect.report.dataset_facts import Facts

WIDTH_IN = 3.5
"""One column of a paper in two columns [in]."""
DPI = 300
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "grid.linewidth": 0.4,
    "grid.color": "#dddddd",
    # A dollar sign in a name is no formula.
    "text.parse_math": False,
}


def write_pictures(facts: Facts, directory: Path) -> tuple[Path, ...]:
    """Draw what there is to draw, a PNG file each.

    Args:
        facts: Facts of the dataset.
        directory: Where the files go; it exists.

    Returns:
        The files that were written.

    Raises:
        OSError: If a file cannot be written.
    """
    written = []
    with mpl.rc_context(_STYLE):
        for name, figure in _figures(facts):
            path = directory / f"{name}.png"
            # Without the version of matplotlib: equal facts, equal bytes.
            figure.savefig(path, dpi=DPI, metadata={"Software": None})
            written.append(path)
    return tuple(written)


def _figures(facts: Facts) -> Iterator[tuple[str, Figure]]:
    if len(facts.landings):
        with _column(2.9) as (figure, axes):
            drawings.landing_map(axes, facts.landings, facts.outcomes)
        yield "landing_map", figure
        with _column(2.7) as (figure, axes):
            drawings.release_map(axes, facts.landings, facts.outcomes)
        yield "release", figure
    if facts.coverage is not None:
        with _column(2.6) as (figure, axes):
            drawings.coverage_map(axes, facts.coverage)
        yield "target_coverage", figure
    if facts.parameters:
        yield "parameters", drawings.parameter_matrix(_figure(*drawings.matrix_size(facts.parameters)), facts)
    with _column(0.5 + 0.28 * len(facts.outcomes.names)) as (figure, axes):
        drawings.outcome_bars(axes, facts.outcomes)
    yield "outcomes", figure
    rows = sum(map(len, facts.peaks.values()))
    if rows:
        with _column(0.7 + 0.26 * rows) as (figure, axes):
            drawings.limit_boxes(axes, facts.peaks)
        yield "limits", figure
    if len(facts.residuals.finite_m):
        with _column(2.0) as (figure, axes):
            drawings.residual_histogram(axes, facts.residuals)
        yield "ballistic_residuals", figure
    if facts.paths:
        with _column(3.0) as (figure, axes):
            drawings.ball_paths(axes, facts.paths, facts.landing_height_m)
        yield "ball_paths", figure
    if facts.motion is not None:
        yield (
            "joint_tracking",
            drawings.joint_lines(_figure(WIDTH_IN, 0.5 + 0.8 * len(facts.motion.joints)), facts.motion),
        )


@contextmanager
def _column(height_in: float) -> Iterator[tuple[Figure, Axes]]:
    figure = _figure(WIDTH_IN, height_in)
    yield figure, figure.add_subplot()


def _figure(width_in: float, height_in: float) -> Figure:
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
