"""The figures of the page, in plotly; text, sizes and colours of the theme are the page's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.report.coverage import Axis
from throwcollect.report.episodes import BallPath, JointMotion, Residuals
from throwcollect.report.landing import Landings
from throwcollect.report.limits import JointPeaks
from throwcollect.report.outcomes import LANDED, Outcomes, in_words, style_of
from throwcollect.report.swept_keys import Parameter
from throwcollect.report.thinning import thinned
from throwcollect.report.throughput import Throughput
from throwcollect.tasks.flight import BALLISTIC_TOLERANCE_M

SCALE = "Viridis"
NEUTRAL = "#8a8f98"
_BLUE = style_of(LANDED).colour
_MOST_SVG_POINTS = 1500
"""Above this a plot is left to WebGL."""
_FLOOR_M = 1e-17
_ABOVE = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}


def landing_map(landings: Landings, outcomes: Outcomes) -> go.Figure:
    """Landings seen from above, coloured by release speed."""
    figure = _coloured(
        landings,
        outcomes,
        columns=("x_m", "y_m", "speed_mps"),
        hover="x %{x:.3f} m, y %{y:.3f} m, released at %{marker.color:.2f} m/s",
        scale_title="release speed [m/s]",
    )
    robot = {"symbol": "star-triangle-up", "size": 13, "color": NEUTRAL, "line": {"width": 1, "color": "white"}}
    figure.add_scatter(x=[0], y=[0], mode="markers", name="robot", marker=robot, hovertemplate="robot<extra></extra>")
    figure.update_xaxes(title="x, forward [m]", constrain="domain")
    figure.update_yaxes(title="y, left [m]", scaleanchor="x", constrain="domain")
    return figure.update_layout(height=460)


def release_map(landings: Landings, outcomes: Outcomes) -> go.Figure:
    """Speed and elevation at release, coloured by the distance at which the ball landed."""
    figure = _coloured(
        landings,
        outcomes,
        columns=("speed_mps", "elevation_rad", "distance_m"),
        hover="%{x:.2f} m/s at %{y:.3f} rad, landed at %{marker.color:.3f} m",
        scale_title="landing distance [m]",
    )
    figure.update_xaxes(title="release speed [m/s]")
    figure.update_yaxes(title="release elevation [rad]")
    return figure.update_layout(height=420)


def _coloured(
    landings: Landings, outcomes: Outcomes, *, columns: tuple[str, str, str], hover: str, scale_title: str
) -> go.Figure:
    """Points with one colour scale, and a marker of its own for each outcome."""
    shown = landings[thinned(len(landings))]
    x, y, colour = (getattr(shown, name) for name in columns)
    kind = go.Scattergl if len(shown) > _MOST_SVG_POINTS else go.Scatter
    size = _size(len(shown))
    figure = go.Figure()
    there = [(code, name) for code, name in enumerate(outcomes.names) if (shown.code == code).any()]
    looks = {
        name: {"size": size, "symbol": style_of(name).symbol}
        | ({} if name == LANDED else {"size": 1.4 * size, "line": {"color": style_of(name).colour, "width": size / 5}})
        for _, name in there
    }
    # Throws that landed come last, on top: they are what the colours are about.
    for code, name in reversed(there):
        own = shown.code == code
        figure.add_trace(
            kind(
                x=_single(x[own]),
                y=_single(y[own]),
                customdata=shown.trial[own],
                mode="markers",
                marker={**looks[name], "color": _single(colour[own]), "coloraxis": "coloraxis"},
                showlegend=False,
                hovertemplate=f"trial %{{customdata}}<br>{hover}<extra>{in_words(name)}</extra>",
            )
        )
    for _, name in there:
        # A colour scale has no colour for the legend.
        legend = {**looks[name], "size": 9, "color": NEUTRAL if name == LANDED else "rgba(0,0,0,0)"}
        figure.add_scatter(x=[None], y=[None], mode="markers", name=in_words(name), marker=legend)
    bar = {"title": {"text": scale_title, "side": "right"}, "thickness": 12, "outlinewidth": 0}
    return figure.update_layout(coloraxis={"colorscale": SCALE, "colorbar": bar}, legend=_ABOVE)


def coverage_map(x: Axis, y: Axis, counts: NDArray[np.intp]) -> go.Figure:
    """Number of throws over two axes of the cells; empty cells are blank."""
    figure = go.Figure(
        go.Heatmap(
            x=x.edges,
            y=y.edges,
            z=np.where(counts, counts, np.nan).T,
            colorscale=SCALE,
            zmin=0,
            xgap=1,
            ygap=1,
            colorbar={"title": {"text": "throws", "side": "right"}, "thickness": 12, "outlinewidth": 0},
            hovertemplate="%{x:.3f}, %{y:.3f}<br>%{z} throws<extra></extra>",
        )
    )
    figure.update_xaxes(title=x.label, showgrid=False)
    figure.update_yaxes(title=y.label, showgrid=False)
    return figure.update_layout(height=460)


def coverage_bars(axis: Axis, counts: NDArray[np.intp]) -> go.Figure:
    """Number of throws over the only axis of the cells."""
    middles, widths = (axis.edges[:-1] + axis.edges[1:]) / 2, np.diff(axis.edges)
    hover = "near %{x:.3f}: %{y} throws<extra></extra>"
    figure = go.Figure(go.Bar(x=middles, width=widths, y=counts, marker_color=_BLUE, hovertemplate=hover))
    figure.update_xaxes(title=axis.label, showgrid=False)
    figure.update_yaxes(title="throws")
    return figure.update_layout(height=460, bargap=0)


def outcome_shares(parameter: Parameter, outcomes: Outcomes) -> go.Figure:
    """Share of each outcome in each bin of a parameter."""
    totals = parameter.counts.sum(axis=1)
    shares = parameter.counts / np.maximum(totals, 1)[:, np.newaxis]
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        figure.add_bar(
            **_bars(parameter),
            y=shares[:, code],
            customdata=np.stack([parameter.counts[:, code], totals], axis=1),
            name=in_words(name),
            marker_color=style_of(name).colour,
            hovertemplate=f"%{{customdata[0]}} of %{{customdata[1]}} (%{{y:.1%}})<extra>{in_words(name)}</extra>",
        )
    figure.update_xaxes(**_axis(parameter), title=_value_title(parameter), showgrid=False)
    figure.update_yaxes(title="share of trials", tickformat=".0%", range=[0, 1])
    return figure.update_layout(barmode="stack", bargap=0, showlegend=False, height=230)


def limit_boxes(peaks: Sequence[JointPeaks]) -> go.Figure:
    """Peaks of each joint over their limit."""
    rows = list(reversed(peaks))
    low, first, median, third, high = zip(*(each.quartiles for each in rows), strict=True)
    figure = go.Figure(
        go.Box(
            y=[f"{each.joint}<br>{each.count} trial{'s' if each.count > 1 else ''}" for each in rows],
            lowerfence=low,
            q1=first,
            median=median,
            q3=third,
            upperfence=high,
            orientation="h",
            line_color=_BLUE,
            showlegend=False,
            name="",
        )
    )
    figure.add_vline(x=1, line={"color": "#D55E00", "width": 1.5, "dash": "dash"})
    figure.update_xaxes(title="peak over limit [-]", range=[0, max(1.08, 1.05 * max(high))])
    return figure.update_layout(height=120 + 46 * len(rows))


def residual_histogram(residuals: Residuals) -> go.Figure:
    """How far flights depart from ballistic motion, on a logarithmic axis."""
    shown = np.maximum(residuals.finite_m, _FLOOR_M)
    low = np.floor(np.log10(shown.min()))
    high = max(np.ceil(np.log10(max(shown.max(), 10 * _FLOOR_M))), low + 1)
    edges = 10 ** np.arange(low, high + 0.1, 0.25)
    counts, _ = np.histogram(np.clip(shown, edges[0], edges[-1]), edges)
    figure = go.Figure(
        go.Bar(
            x=(edges[:-1] + edges[1:]) / 2,
            width=np.diff(edges),
            y=counts,
            marker_color=_BLUE,
            hovertemplate="%{y} flights near %{x:.1e} m<extra></extra>",
        )
    )
    figure.add_vline(x=BALLISTIC_TOLERANCE_M, line={"color": "#D55E00", "width": 1.5, "dash": "dash"})
    ends = [low - 0.2, max(high, np.log10(BALLISTIC_TOLERANCE_M)) + 0.5]
    figure.update_xaxes(title="distance from ballistic motion [m]", type="log", range=ends, exponentformat="e")
    figure.update_yaxes(title="flights")
    return figure.update_layout(height=300, bargap=0)


def throughput_line(throughput: Throughput) -> go.Figure:
    """Throws a second over the time of collecting."""
    unit, seconds = (
        ("h", 3600) if throughput.edges_s[-1] > 7200 else ("min", 60) if throughput.edges_s[-1] > 120 else ("s", 1)
    )
    edges = throughput.edges_s / seconds
    figure = go.Figure(
        go.Scatter(
            x=np.repeat(edges, 2)[1:-1],
            y=np.repeat(throughput.rate_per_s, 2),
            mode="lines",
            fill="tozeroy",
            line={"color": _BLUE, "width": 1.5},
            name="throws",
            hovertemplate="%{y:.1f} throws/s<extra></extra>",
        )
    )
    for kind, name, symbol, colour in (
        ("fail", "a simulation did not bring a trial back", "x", "#D55E00"),
        ("lost", "a trial was lost", "diamond", NEUTRAL),
    ):
        times = np.array(throughput.troubles[kind]) / seconds
        if len(times):
            times = times[thinned(len(times), 500)]
            marker = {"symbol": symbol, "color": colour, "size": 9}
            rows = np.zeros(len(times))
            figure.add_scatter(x=times, y=rows, mode="markers", name=name, marker=marker, cliponaxis=False)
    for time in throughput.resumed_s:
        figure.add_vline(x=time / seconds, line={"color": NEUTRAL, "width": 1.5, "dash": "dot"})
    figure.update_xaxes(title=f"time spent collecting [{unit}]", range=[0, edges[-1]])
    figure.update_yaxes(title="throws per second [1/s]", rangemode="tozero")
    return figure.update_layout(height=300, legend=_ABOVE, showlegend=len(figure.data) > 1)


def ball_views(paths: Sequence[BallPath], landing_height_m: float | None) -> tuple[go.Figure, go.Figure]:
    """Paths of the ball seen from the robot's right, and from above."""
    side, above = _ball_lines(paths, 2), _ball_lines(paths, 1)
    if landing_height_m is not None:
        side.add_hline(y=landing_height_m, line={"color": NEUTRAL, "width": 1})
    side.update_yaxes(title="z, up [m]")
    above.update_yaxes(title="y, left [m]")
    return side, above


def _ball_lines(paths: Sequence[BallPath], axis: int) -> go.Figure:
    """Paths of the ball: x against another coordinate."""
    letter = "xyz"[axis]
    figure = go.Figure()
    for number, path in enumerate(paths):
        style = style_of(path.outcome)
        colour = style.colour if path.outcome != LANDED else shade(number, paths)
        name = f"trial {path.trial}" + (f", {in_words(path.outcome)}" if path.outcome != LANDED else "")
        x, y = _single(path.positions[:, 0]), _single(path.positions[:, axis])
        release = len(x) - 1 if path.release is None else path.release
        hover = f"x %{{x:.3f}} m, {letter} %{{y:.3f}} m<extra>{name}</extra>"
        common = {"mode": "lines", "legendgroup": name, "name": name, "hovertemplate": hover}
        held = {"color": colour, "width": 1, "dash": "dot"}
        figure.add_scatter(x=x[: release + 1], y=y[: release + 1], line=held, showlegend=False, **common)
        figure.add_scatter(x=x[release:], y=y[release:], line={"color": colour, "width": 2}, **common)
        marker = {"color": colour, "size": 8, "symbol": "circle-open", "line": {"width": 2}}
        if path.release is not None:
            figure.add_scatter(
                x=x[release : release + 1],
                y=y[release : release + 1],
                marker=marker,
                showlegend=False,
                **{**common, "mode": "markers"},
            )
    figure.update_xaxes(title="x, forward [m]", constrain="domain")
    figure.update_yaxes(scaleanchor="x", constrain="domain")
    return figure.update_layout(height=480, legend=_ABOVE)


def shade(number: int, paths: Sequence[BallPath]) -> str:
    """Colour of a path that landed: from dark to bright, from the nearest to the farthest."""
    landed = [index for index, path in enumerate(paths) if path.outcome == LANDED]
    shades = ("#3b528b", "#2c728e", "#21908d", "#27ad81", "#5dc863", "#aadc32")
    return shades[landed.index(number) * (len(shades) - 1) // max(len(landed) - 1, 1)]


def joint_lines(motion: JointMotion, column: int) -> go.Figure:
    """Commanded and measured position of one joint."""
    figure = go.Figure()
    for values, name, line in (
        (motion.measured, "measured", {"color": "#56B4E9", "width": 4}),
        (motion.commanded, "commanded", {"color": "#D55E00", "width": 1.5, "dash": "dash"}),
    ):
        hover = f"%{{x:.3f}} s, %{{y:.4f}} rad<extra>{name}</extra>"
        figure.add_scatter(
            x=_single(motion.times_s),
            y=_single(values[:, column]),
            mode="lines",
            name=name,
            line=line,
            hovertemplate=hover,
        )
    if motion.release_s is not None:
        figure.add_vline(x=motion.release_s, line={"color": NEUTRAL, "width": 1.5, "dash": "dot"})
    figure.update_xaxes(title="time [s]")
    figure.update_yaxes(title="position [rad]", range=list(motion.span(column)))
    return figure.update_layout(height=230, showlegend=False)


def _bars(parameter: Parameter) -> dict[str, Any]:
    """Where the bars of a parameter stand."""
    if parameter.steps is not None:
        return {"x": [f"{value:g}" for value in parameter.steps], "width": 0.7}
    return {"x": (parameter.edges[:-1] + parameter.edges[1:]) / 2, "width": np.diff(parameter.edges)}


def _axis(parameter: Parameter) -> dict[str, Any]:
    if parameter.steps is not None:
        return {"type": "category"}
    return {"type": "log", **parameter.ticks} if parameter.logarithmic else {}


def _value_title(parameter: Parameter) -> str:
    return f"value [{parameter.unit or '-'}]"


def _size(count: int) -> float:
    return 8 if count <= 300 else 6 if count <= 1500 else 4


def _single(values: Any) -> Any:
    """Single precision, which no eye can tell from double."""
    return np.asarray(values, dtype=np.float32)
