"""Figures: swept keys, outcomes, limits and throughput of any dataset, and maps of points with bodies around them.

Text, sizes and colours of the theme are the page's own.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.publish.report.contents import Tile
from throwcollect.publish.report.measured import (
    Outcomes,
    SweptKey,
    choose_points,
    describe,
    read_numbers,
)
from throwcollect.robots.surroundings import BodyLook
from throwcollect.tasks.outcome_styles import LANDED, style_of
from throwcollect.wording import format_count

BLUE = style_of(LANDED).colour
NEUTRAL = "#8a8f98"
LEGEND_ABOVE = {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"}
LIMIT_LINE = {"color": "#D55E00", "width": 1.5, "dash": "dash"}
MOMENT_LINE = {"color": NEUTRAL, "width": 1.5, "dash": "dot"}

MOST_KEYS = 8
"""Most swept keys in a matrix of pairs."""
_MOST_MATRIX_POINTS = 8000
"""Most points in all panels of the matrix together; a browser redraws more points slowly."""
_LEAST_ROOM_M = 0.15
"""Least room around the points of a map, so that a bin around them can be seen."""
_INTERVALS = 40
"""Most intervals of time in which trials are counted."""
_CELL_PX = 128


SCALE = "Viridis"
"""Colour scale of numbers."""
_MOST_SVG_POINTS = 1500
"""Plots of more points are drawn by WebGL, which is faster."""


def draw_parameter_matrix(parameters: Sequence[SweptKey], outcomes: Outcomes) -> go.Figure:
    """Draw each pair of swept keys, of which there are two to `MOST_KEYS`, below the diagonal."""
    chosen = choose_points(len(outcomes.codes), count_matrix_points(parameters))
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        trials = chosen[outcomes.codes[chosen] == code]
        style, dimensions = outcomes.style_of(name), []
        for each in parameters:
            above, _, last = each.key.rpartition(".")
            label = f"{last}<br>{above} [{each.unit or '-'}]"
            axis = {"type": "log" if each.logarithmic else "linear"}
            dimensions.append({"label": label, "values": single_precision(each.values[trials]), "axis": axis})
        figure.add_splom(
            dimensions=dimensions,
            customdata=trials,
            diagonal_visible=False,
            showupperhalf=False,
            marker={"color": style.colour, "symbol": style.symbol, "size": 4, "opacity": 0.8},
            name=describe(name),
            hovertemplate=f"trial %{{customdata}}<br>%{{x:.4g}}, %{{y:.4g}}<extra>{describe(name)}</extra>",
        )
    return figure.update_layout(height=90 + _CELL_PX * len(parameters), legend=LEGEND_ABOVE)


def count_matrix_points(parameters: Sequence[SweptKey]) -> int:
    """Count the trials that each panel of the matrix shows at most."""
    return _MOST_MATRIX_POINTS // max(len(parameters) * (len(parameters) - 1) // 2, 4)


def draw_outcome_shares(parameter: SweptKey, outcomes: Outcomes) -> go.Figure:
    """Draw the share of each outcome in each bin of a parameter."""
    totals = parameter.counts.sum(axis=1)
    shares = parameter.counts / np.maximum(totals, 1)[:, np.newaxis]
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        figure.add_bar(
            **place_bars(parameter.edges),
            y=shares[:, code],
            customdata=np.stack([parameter.counts[:, code], totals], axis=1),
            name=describe(name),
            marker_color=outcomes.style_of(name).colour,
            hovertemplate=f"%{{customdata[0]}} of %{{customdata[1]}} (%{{y:.1%}})<extra>{describe(name)}</extra>",
        )
    kind = "log" if parameter.logarithmic else "linear"
    figure.update_xaxes(type=kind, title=f"value [{parameter.unit or '-'}]", showgrid=False)
    figure.update_yaxes(title="share of trials", tickformat=".0%", range=[0, 1])
    return figure.update_layout(barmode="stack", bargap=0, showlegend=False, height=230)


def draw_limit_boxes(peaks: Mapping[str, NDArray[np.float64]]) -> go.Figure:
    """Draw the peaks of each joint over their limit, as `summarise_peaks` finds them, the first joint on top."""
    figure = go.Figure()
    for joint, shares in [*peaks.items()][::-1]:
        figure.add_box(
            x=single_precision(shares[choose_points(len(shares))]),
            name=f"{joint}<br>{format_count(len(shares), 'trial')}",
            boxpoints=False,
            line_color=BLUE,
            showlegend=False,
        )
    figure.add_vline(x=1, line=LIMIT_LINE)
    most = max(float(shares.max()) for shares in peaks.values())
    figure.update_xaxes(title="peak over limit [-]", range=[0, max(1.08, 1.05 * most)])
    return figure.update_layout(height=120 + 46 * len(peaks))


def draw_throughput(times: Mapping[str, list[float]], total_s: float, noun: str) -> go.Figure:
    """Draw trials a second over the time of collecting, as `measure_times` finds it; `noun` is the word for a trial."""
    commits = times["commit"]
    edges_s = np.linspace(0, total_s, min(_INTERVALS, max(len(commits) // 5, 1)) + 1)
    rate_per_s = np.histogram(commits, edges_s)[0] / np.diff(edges_s)
    unit, seconds = ("h", 3600) if total_s > 7200 else ("min", 60) if total_s > 120 else ("s", 1)
    edges = edges_s / seconds
    line = {"color": BLUE, "width": 1.5, "shape": "hv"}
    hover = f"%{{y:.1f}} {noun}s/s<extra></extra>"
    # Each rate holds from one edge to the next.
    figure = go.Figure(go.Scatter(x=edges, y=[*rate_per_s, rate_per_s[-1]], line=line, hovertemplate=hover))
    figure.update_traces(mode="lines", fill="tozeroy")
    # The first opening began the collection; each later one resumed it.
    for time_s in times["opened"][1:]:
        figure.add_vline(x=time_s / seconds, line=MOMENT_LINE)
    figure.update_xaxes(title=f"time spent collecting [{unit}]", range=[0, edges[-1]])
    figure.update_yaxes(title=f"{noun}s per second [1/s]", rangemode="tozero")
    return figure.update_layout(height=300, showlegend=False)


def place_bars(edges: NDArray[np.float64]) -> dict[str, Any]:
    """Place bars between edges, shape ``(n_bars + 1,)``."""
    return {"x": (edges[:-1] + edges[1:]) / 2, "width": np.diff(edges)}


def single_precision(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Round values to single precision, which halves the page and makes no visible difference."""
    return values.astype(np.float32)


@dataclass(frozen=True)
class Points:
    """Trials that ended at a place, of any outcome; each array has the shape ``(n,)``.

    Attributes:
        row: Place of the trial in the table.
        trial: Number of the trial.
        x_m: Centre of the object in world [m], forward of the robot.
        y_m: Centre of the object in world [m], left of the robot.
        distance_m: How far it got [m].
        speed_mps: Speed with which it left the tool [m/s].
        code: Outcome, as index into `Outcomes.names`.
    """

    row: NDArray[np.intp]
    trial: NDArray[np.int64]
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    distance_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    code: NDArray[np.intp]

    @classmethod
    def read(cls, throws: pa.Table, outcomes: Outcomes, end: str, distance: str | None, speed: str) -> Points:
        """Read those that have an `end`, such as ``landing``, from a table.

        The other names are those of columns; without one of distances, they are from the robot's base, horizontal.
        """
        x, y = read_numbers(throws, f"{end}_x_m"), read_numbers(throws, f"{end}_y_m")
        far = np.hypot(x, y) if distance is None else read_numbers(throws, distance)
        trials = np.asarray(throws["trial"].to_numpy())
        points = cls(np.arange(len(throws)), trials, x, y, far, read_numbers(throws, speed), outcomes.codes)
        return points[np.isfinite(x + y + far)]

    def __len__(self) -> int:
        return len(self.trial)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Points:
        return Points(**{name: column[rows] for name, column in vars(self).items()})

    def show_ranges(self, distance: str, speed: str) -> tuple[Tile, ...]:
        """Show how far and how fast the trials were, under these labels; nothing if there are none."""
        if not len(self):
            return ()
        return (
            (f"{self.distance_m.min():.2f}–{self.distance_m.max():.2f} m", distance),
            (f"{self.speed_mps.min():.2f}–{self.speed_mps.max():.2f} m/s", speed),
        )


def draw_map(points: Points, outcomes: Outcomes, bodies: Sequence[BodyLook] = (), *, speed: str | None) -> go.Figure:
    """Draw places from above, coloured by the speed of this name, or by outcome; there is at least one."""
    figure = draw_coloured(
        points,
        outcomes,
        (points.x_m, points.y_m, points.speed_mps),
        hover="x %{x:.3f} m, y %{y:.3f} m" + (f", {speed} %{{marker.color:.2f}} m/s" if speed is not None else ""),
        scale_title=None if speed is None else f"{speed} [m/s]",
    )
    _draw_bodies(figure, bodies)
    places = np.column_stack([points.x_m, points.y_m])
    room = max(0.08 * float(np.ptp(places, axis=0).max()), _LEAST_ROOM_M)
    low, high = places.min(axis=0) - room, places.max(axis=0) + room
    # If the robot is beyond the points, an arrow at their edge points to it.
    x, y = np.clip(0.0, low, high).tolist()
    name = f"robot, {math.hypot(x, y):.1f} m farther" if x or y else "robot"
    symbol, angle = "arrow" if x or y else "star-triangle-up", math.degrees(math.atan2(-x, -y))
    robot: dict[str, Any] = {"symbol": symbol, "angle": angle}
    robot |= {"size": 15, "color": NEUTRAL, "line": {"width": 1, "color": "white"}}
    hover = f"{name}<extra></extra>"
    figure.add_scatter(x=[x], y=[y], mode="markers", name=name, marker=robot, hovertemplate=hover, cliponaxis=False)
    figure.update_xaxes(title="x, forward [m]", range=[low[0], high[0]])
    figure.update_yaxes(title="y, left [m]", scaleanchor="x", range=[low[1], high[1]])
    return figure.update_layout(height=460)


def _draw_bodies(figure: go.Figure, bodies: Sequence[BodyLook]) -> None:
    """Draw the outlines of bodies behind all that a figure shows; the more of a name, the paler each is."""
    shown, same = len(figure.data), Counter(body.name for body in bodies)
    for body in bodies:
        first, *others = body.above_m
        x, y = zip(first, *others, first, strict=True)
        red, green, blue = bytes.fromhex(body.color[1:])
        fill = f"rgba({red}, {green}, {blue}, {0.2 / same[body.name]:.3f})"
        look = {"mode": "lines", "fill": "toself", "fillcolor": fill, "line": {"color": body.color, "width": 1}}
        figure.add_scatter(x=x, y=y, **look, name=body.name, showlegend=False, hoverinfo="skip")
    figure.data = (*figure.data[shown:], *figure.data[:shown])


def draw_coloured(
    points: Points,
    outcomes: Outcomes,
    columns: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    *,
    hover: str,
    scale_title: str | None,
) -> go.Figure:
    """Draw numbers x and y of points, coloured by a third one, or without a title of that in the colours of outcomes.

    Each outcome has a marker of its own.
    """
    chosen = choose_points(len(points))
    shown, (x, y, colour) = points[chosen], (column[chosen] for column in columns)
    kind = go.Scattergl if len(shown) > _MOST_SVG_POINTS else go.Scatter
    size = 8 if len(shown) <= 300 else 6 if len(shown) <= 1500 else 4
    figure = go.Figure()
    present = [(code, name) for code, name in enumerate(outcomes.names) if (shown.code == code).any()]
    # Throws that succeeded are drawn last, on top of the others, because the colour scale is mostly about them.
    for code, name in reversed(present):
        own, style = shown.code == code, outcomes.style_of(name)
        look: dict[str, object] = {"color": style.colour}
        if scale_title is not None:
            look = {"color": single_precision(colour[own]), "coloraxis": "coloraxis"}
            if name != outcomes.success:
                look |= {"size": 1.4 * size, "line": {"color": style.colour, "width": size / 5}}
        figure.add_trace(
            kind(
                x=single_precision(x[own]),
                y=single_precision(y[own]),
                customdata=shown.trial[own],
                mode="markers",
                marker={"symbol": style.symbol, "size": size, **look},
                showlegend=False,
                hovertemplate=f"trial %{{customdata}}<br>{hover}<extra>{describe(name)}</extra>",
            )
        )
    # The legend has markers of its own, because the points have no single colour.
    for _, name in present:
        style = outcomes.style_of(name)
        look = {"symbol": style.symbol, "color": style.colour if scale_title is None else NEUTRAL}
        if scale_title is not None and name != outcomes.success:
            look = {"symbol": f"{style.symbol}-open", "color": style.colour}
        figure.add_scatter(x=[None], y=[None], mode="markers", name=describe(name), marker={**look, "size": 9})
    axis = {} if scale_title is None else {"colorscale": SCALE, "colorbar": colour_bar(scale_title)}
    return figure.update_layout(coloraxis=axis, legend=LEGEND_ABOVE)


def colour_bar(title: str) -> dict[str, object]:
    """Describe the bar that explains a scale of colours."""
    return {"title": {"text": title, "side": "right"}, "thickness": 12, "outlinewidth": 0}
