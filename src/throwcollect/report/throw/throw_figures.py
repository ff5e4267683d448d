"""Figures of throws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.dataset.motion import Joint
from throwcollect.dataset.throw import BodyEvent, Throw
from throwcollect.report.figures import (
    BLUE,
    LEGEND_ABOVE,
    LIMIT_LINE,
    MOMENT_LINE,
    NEUTRAL,
    place_bars,
    single_precision,
)
from throwcollect.report.maps import SCALE, colour_bar, draw_bodies, draw_coloured
from throwcollect.report.outcomes import Outcomes, in_words
from throwcollect.report.throw.measured import CellAxis, Landings, Residuals
from throwcollect.robots.surroundings import BodyLook
from throwcollect.tasks.throw.flight import BALLISTIC_TOLERANCE_M

_SHADES = ("#3b528b", "#2c728e", "#21908d", "#27ad81", "#5dc863", "#aadc32")
"""Colours of paths that landed, from the nearest to the farthest."""
_FEW = 8
"""Up to this many throws in a cell, the scale has a mark for each number of throws; plotly would also mark halves."""
FLOOR_M = 1e-17
"""Smaller residuals are drawn as this value, as 0 has no place on a logarithmic axis."""


def draw_release_map(landings: Landings, outcomes: Outcomes) -> go.Figure:
    """Draw speed and elevation at release, coloured by the distance at which the ball landed."""
    figure = draw_coloured(
        landings,
        outcomes,
        columns=("speed_mps", "elevation_deg", "distance_m"),
        hover="%{x:.2f} m/s at %{y:.1f}°, landed at %{marker.color:.3f} m",
        scale_title="landing distance [m]",
    )
    figure.update_xaxes(title="release speed [m/s]")
    figure.update_yaxes(title="release elevation [°]")
    return figure.update_layout(height=420)


def draw_coverage_map(x: CellAxis, y: CellAxis, counts: NDArray[np.intp]) -> go.Figure:
    """Draw the number of throws over two axes of the cells; empty cells are blank."""
    most = max(int(counts.max()), 1)
    marks = {"dtick": 1} if most <= _FEW else {}
    figure = go.Figure(
        go.Heatmap(
            x=x.edges,
            y=y.edges,
            z=np.where(counts, counts, np.nan).T,
            colorscale=SCALE,
            zmin=0,
            zmax=most,
            xgap=1,
            ygap=1,
            colorbar={**colour_bar("throws"), **marks},
            hovertemplate="%{x:.3f}, %{y:.3f}<br>%{z} throws<extra></extra>",
        )
    )
    figure.update_xaxes(title=x.label, showgrid=False)
    figure.update_yaxes(title=y.label, showgrid=False)
    return figure.update_layout(height=460)


def draw_coverage_bars(axis: CellAxis, counts: NDArray[np.intp]) -> go.Figure:
    """Draw the number of throws over the only axis of the cells."""
    hover = "near %{x:.3f}: %{y} throws<extra></extra>"
    figure = go.Figure(go.Bar(**place_bars(axis.edges), y=counts, marker_color=BLUE, hovertemplate=hover))
    figure.update_xaxes(title=axis.label, showgrid=False)
    figure.update_yaxes(title="throws")
    return figure.update_layout(height=460, bargap=0)


def draw_residuals(residuals: Residuals) -> go.Figure:
    """Draw how far flights depart from ballistic motion, on a logarithmic axis."""
    shown = np.maximum(residuals.finite_m, FLOOR_M)
    low = np.floor(np.log10(shown.min()))
    high = max(np.ceil(np.log10(max(shown.max(), 10 * FLOOR_M))), low + 1)
    # There are four bins for each power of ten; 0.1 more includes the last edge in spite of rounding.
    edges = 10 ** np.arange(low, high + 0.1, 0.25)
    counts, _ = np.histogram(np.clip(shown, edges[0], edges[-1]), edges)
    hover = "%{y} flights near %{x:.1e} m<extra></extra>"
    figure = go.Figure(go.Bar(**place_bars(edges), y=counts, marker_color=BLUE, hovertemplate=hover))
    figure.add_vline(x=BALLISTIC_TOLERANCE_M, line=LIMIT_LINE)
    ends = [low - 0.2, max(high, np.log10(BALLISTIC_TOLERANCE_M)) + 0.5]
    figure.update_xaxes(title="distance from ballistic motion [m]", type="log", range=ends, exponentformat="e")
    figure.update_yaxes(title="flights")
    return figure.update_layout(height=300, bargap=0)


def draw_ball_views(
    throws: Sequence[Throw], outcomes: Outcomes, landing_height_m: float | None, bodies: Sequence[BodyLook] = ()
) -> tuple[go.Figure, go.Figure]:
    """Draw paths of the ball as seen from the robot's right, and from above."""
    side, above = _draw_paths(throws, outcomes, 2), _draw_paths(throws, outcomes, 1)
    draw_bodies(side, bodies, "side_m")
    draw_bodies(above, bodies, "above_m")
    if landing_height_m is not None:
        side.add_hline(y=landing_height_m, line={"color": NEUTRAL, "width": 1})
    side.update_yaxes(title="z, up [m]")
    above.update_yaxes(title="y, left [m]")
    return side, above


def _draw_paths(throws: Sequence[Throw], outcomes: Outcomes, axis: int) -> go.Figure:
    """Draw paths of the ball: x against another coordinate."""
    letter = "xyz"[axis]
    figure = go.Figure()
    landed = [throw.trial for throw in throws if throw.outcome == outcomes.success]
    for throw in throws:
        name, colour = f"trial {throw.trial}, {in_words(throw.outcome)}", outcomes.style_of(throw.outcome).colour
        if throw.outcome == outcomes.success:
            name = f"trial {throw.trial}"
            colour = _SHADES[landed.index(throw.trial) * (len(_SHADES) - 1) // max(len(landed) - 1, 1)]
        x, y = (single_precision(throw.ball.position[:, each]) for each in (0, axis))
        left = throw.events.release
        release = len(x) - 1 if left is None else int(np.searchsorted(throw.ball.time_s, left.time_s))
        hover = f"x %{{x:.3f}} m, {letter} %{{y:.3f}} m<extra>{name}</extra>"
        common = {"legendgroup": name, "name": name, "hovertemplate": hover}
        # Both lines include the sample of the release, so that they meet.
        held, free = slice(release + 1), slice(release, None)
        line = {"color": colour, "width": 1, "dash": "dot"}
        figure.add_scatter(x=x[held], y=y[held], mode="lines", line=line, showlegend=False, **common)
        figure.add_scatter(x=x[free], y=y[free], mode="lines", line={"color": colour, "width": 2}, **common)
        if left is not None:
            at = slice(release, release + 1)
            marker = {"color": colour, "size": 8, "symbol": "circle-open", "line": {"width": 2}}
            figure.add_scatter(x=x[at], y=y[at], mode="markers", marker=marker, showlegend=False, **common)
    figure.update_xaxes(title="x, forward [m]", constrain="domain")
    figure.update_yaxes(scaleanchor="x", constrain="domain")
    return figure.update_layout(height=480, legend=LEGEND_ABOVE)


def draw_joint(
    joint: Joint, commanded: NDArray[np.float64], release: BodyEvent | None, scale: tuple[float, str]
) -> go.Figure:
    """Draw commanded and measured position of one joint; the scale is a factor on these and the unit it leads to."""
    factor, unit = scale
    figure = go.Figure()
    for values, name, line in (
        (joint.position, "measured", {"color": "#56B4E9", "width": 4}),
        (commanded, "commanded", {"color": "#D55E00", "width": 1.5, "dash": "dash"}),
    ):
        figure.add_scatter(
            x=single_precision(joint.time_s),
            y=single_precision(factor * values),
            mode="lines",
            name=name,
            line=line,
            hovertemplate=f"%{{x:.3f}} s, %{{y:.2f}}{unit}<extra>{name}</extra>",
        )
    if release is not None:
        figure.add_vline(x=release.time_s, line=MOMENT_LINE, name="release")
    figure.update_xaxes(title="time [s]")
    positions = factor * np.concatenate([commanded, joint.position])
    figure.update_yaxes(title=f"position [{unit.strip()}]", range=_choose_span(positions))
    return figure.update_layout(height=230, showlegend=False)


def _choose_span(positions: NDArray[np.float64]) -> list[float]:
    """Choose the range of positions to show [°; mm]: at least 6, so that a joint at rest looks at rest."""
    finite = positions[np.isfinite(positions)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    room = max(0.05 * (high - low), 3.0 - (high - low) / 2)
    return [low - room, high + room]
