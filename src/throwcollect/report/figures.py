"""Figures that any dataset has.

Text, sizes and colours of the theme are the page's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.report.measured import JointPeaks, SweptKey, Throughput, choose_points
from throwcollect.report.outcomes import LANDED, Outcomes, in_words, style_of

BLUE = style_of(LANDED).colour
NEUTRAL = "#8a8f98"
LEGEND_ABOVE = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}
LIMIT_LINE = {"color": "#D55E00", "width": 1.5, "dash": "dash"}
MOMENT_LINE = {"color": NEUTRAL, "width": 1.5, "dash": "dot"}

MOST_KEYS = 8
"""Most swept keys in a matrix of pairs."""
_MOST_MATRIX_POINTS = 8000
"""Most points in all panels of the matrix together; a browser redraws more points slowly."""
_CELL_PX = 128
_CELL_GAP = 0.012


def draw_parameter_matrix(parameters: Sequence[SweptKey], outcomes: Outcomes) -> go.Figure:
    """Draw each pair of at most `MOST_KEYS` swept keys below the diagonal, and on it how often each value occurs."""
    count = len(parameters)
    chosen = choose_points(len(outcomes.codes), count_matrix_points(parameters))
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        trials = chosen[outcomes.codes[chosen] == code]
        style = outcomes.style_of(name)
        for row in range(1, count):
            for column in range(row):
                figure.add_scatter(
                    x=single_precision(parameters[column].values[trials]),
                    y=single_precision(parameters[row].values[trials]),
                    customdata=trials,
                    xaxis=_name_axis("x", column),
                    yaxis=_name_axis("y", row),
                    mode="markers",
                    marker={"color": style.colour, "symbol": style.symbol, "size": 4, "opacity": 0.8},
                    name=in_words(name),
                    legendgroup=name,
                    # An outcome is in every panel of the matrix, but in the legend only once.
                    showlegend=row == 1,
                    hovertemplate=f"trial %{{customdata}}<br>%{{x:.4g}}, %{{y:.4g}}<extra>{in_words(name)}</extra>",
                )
    for index, parameter in enumerate(parameters):
        figure.add_bar(
            **place_bars(parameter.edges),
            y=parameter.counts.sum(axis=1),
            xaxis=_name_axis("x", index),
            yaxis=_name_axis("y", count + index),
            marker={"color": NEUTRAL, "opacity": 0.55},
            showlegend=False,
            hovertemplate="%{y} trials near %{x:.4g}<extra></extra>",
        )
    figure.update_layout(_matrix_axes(parameters))
    legend = {"x": 1, "y": 1, "xanchor": "right", "yanchor": "top"}
    return figure.update_layout(height=90 + _CELL_PX * max(count, 2), bargap=0, legend=legend)


def count_matrix_points(parameters: Sequence[SweptKey]) -> int:
    """Count the trials that each panel of the matrix shows at most."""
    return _MOST_MATRIX_POINTS // max(len(parameters) * (len(parameters) - 1) // 2, 4)


def _matrix_axes(parameters: Sequence[SweptKey]) -> dict[str, object]:
    """Axes of the matrix: x and y of each parameter, numbered as the parameters, then the y axes of the counts."""
    count = len(parameters)
    axes: dict[str, object] = {}
    for index, parameter in enumerate(parameters):
        across = [index / count + _CELL_GAP / 2, (index + 1) / count - _CELL_GAP / 2]
        down = [1 - across[1], 1 - across[0]]
        last, above = parameter.short_label
        title = {"text": f"{last}<br>{above}", "font": {"size": 10}}
        shared = {"title": title, "tickfont": {"size": 9}, "nticks": 4, "range": _matrix_range(parameter)}
        shared |= {"type": "log", **parameter.ticks} if parameter.logarithmic else {}
        # Each column has its labels below its lowest panel; in the last column, this is the panel with the counts.
        lowest = _name_axis("y", count - 1 if index < count - 1 else count + index)
        axes[_name_axis("xaxis", index)] = {**shared, "domain": across, "anchor": lowest, "tickangle": 0}
        if index:
            axes[_name_axis("yaxis", index)] = {**shared, "domain": down, "anchor": "x"}
        counts = {"domain": down, "anchor": _name_axis("x", index), "showticklabels": False, "showgrid": False}
        axes[_name_axis("yaxis", count + index)] = {**counts, "rangemode": "tozero"}
    return axes


def _matrix_range(parameter: SweptKey) -> list[float]:
    ends = parameter.edges[[0, -1]]
    low, high = np.log10(ends) if parameter.logarithmic else ends
    room = 0.04 * (high - low)
    return [float(low - room), float(high + room)]


def _name_axis(letter: str, index: int) -> str:
    """Name of an axis: with ``x`` in a trace, with ``xaxis`` in a layout."""
    return letter if index == 0 else f"{letter}{index + 1}"


def draw_outcome_shares(parameter: SweptKey, outcomes: Outcomes) -> go.Figure:
    """Draw the share of each outcome in each bin of a parameter."""
    totals = parameter.counts.sum(axis=1)
    shares = parameter.counts / np.maximum(totals, 1)[:, np.newaxis]
    bars = place_bars(parameter.edges)
    axis: dict[str, Any] = {}
    if parameter.steps is not None:
        bars, axis = {"x": [f"{value:g}" for value in parameter.steps], "width": 0.7}, {"type": "category"}
    elif parameter.logarithmic:
        axis = {"type": "log", **parameter.ticks}
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        figure.add_bar(
            **bars,
            y=shares[:, code],
            customdata=np.stack([parameter.counts[:, code], totals], axis=1),
            name=in_words(name),
            marker_color=outcomes.style_of(name).colour,
            hovertemplate=f"%{{customdata[0]}} of %{{customdata[1]}} (%{{y:.1%}})<extra>{in_words(name)}</extra>",
        )
    figure.update_xaxes(**axis, title=f"value [{parameter.unit or '-'}]", showgrid=False)
    figure.update_yaxes(title="share of trials", tickformat=".0%", range=[0, 1])
    return figure.update_layout(barmode="stack", bargap=0, showlegend=False, height=230)


def draw_limit_boxes(peaks: Sequence[JointPeaks]) -> go.Figure:
    """Draw the peaks of each joint over their limit, the first joint on top."""
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
            line_color=BLUE,
            showlegend=False,
            name="",
        )
    )
    figure.add_vline(x=1, line=LIMIT_LINE)
    figure.update_xaxes(title="peak over limit [-]", range=[0, max(1.08, 1.05 * max(high))])
    return figure.update_layout(height=120 + 46 * len(rows))


def draw_throughput(throughput: Throughput, noun: str) -> go.Figure:
    """Draw trials a second over the time of collecting; `noun` is the word for a trial."""
    total_s = throughput.edges_s[-1]
    unit, seconds = ("h", 3600) if total_s > 7200 else ("min", 60) if total_s > 120 else ("s", 1)
    edges = throughput.edges_s / seconds
    figure = go.Figure(
        go.Scatter(
            # Each rate is a step from one edge to the next, so each edge appears twice, but the first and last once.
            x=np.repeat(edges, 2)[1:-1],
            y=np.repeat(throughput.rate_per_s, 2),
            mode="lines",
            fill="tozeroy",
            line={"color": BLUE, "width": 1.5},
            name=f"{noun}s",
            hovertemplate=f"%{{y:.1f}} {noun}s/s<extra></extra>",
        )
    )
    for times_s, name, symbol, colour in (
        (throughput.failed_s, "a simulation did not bring a trial back", "x", "#D55E00"),
        (throughput.lost_s, "a trial was lost", "diamond", NEUTRAL),
    ):
        if times_s:
            x = np.array(times_s)[choose_points(len(times_s), 500)] / seconds
            marker = {"symbol": symbol, "color": colour, "size": 9}
            figure.add_scatter(x=x, y=np.zeros(len(x)), mode="markers", name=name, marker=marker, cliponaxis=False)
    for time_s in throughput.resumed_s:
        figure.add_vline(x=time_s / seconds, line=MOMENT_LINE)
    figure.update_xaxes(title=f"time spent collecting [{unit}]", range=[0, edges[-1]])
    figure.update_yaxes(title=f"{noun}s per second [1/s]", rangemode="tozero")
    return figure.update_layout(height=300, legend=LEGEND_ABOVE, showlegend=len(figure.data) > 1)


def place_bars(edges: NDArray[np.float64]) -> dict[str, Any]:
    """Place bars between edges, shape ``(n_bars + 1,)``."""
    return {"x": (edges[:-1] + edges[1:]) / 2, "width": np.diff(edges)}


def single_precision(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round values to single precision, which halves the page and makes no visible difference."""
    return values.astype(np.float32)
