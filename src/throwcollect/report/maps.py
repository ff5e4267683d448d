"""Maps: points seen from above, coloured by a number or by their outcome, and the bodies around them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.report.figures import LEGEND_ABOVE, NEUTRAL, single_precision
from throwcollect.report.measured import choose_points
from throwcollect.report.outcomes import Outcomes, in_words
from throwcollect.robots.surroundings import BodyLook

SCALE = "Viridis"
"""Colour scale of numbers."""
_MOST_SVG_POINTS = 1500
"""Plots of more points are drawn by WebGL, which is faster."""


@dataclass(frozen=True)
class Points:
    """Trials that ended at a place, of any outcome; each array has the shape ``(n,)``.

    Attributes:
        row: Place of the trial in the table.
        trial: Number of the trial.
        x_m: Centre of the object in world [m], forward of the robot.
        y_m: Centre of the object in world [m], left of the robot.
        speed_mps: Speed with which it left the tool [m/s].
        code: Outcome, as index into `Outcomes.names`.
    """

    row: NDArray[np.intp]
    trial: NDArray[np.int64]
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    speed_mps: NDArray[np.float64]
    code: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.trial)

    def __getitem__(self: AnyPoints, rows: NDArray[np.intp] | NDArray[np.bool_]) -> AnyPoints:
        return type(self)(**{name: column[rows] for name, column in vars(self).items()})


AnyPoints = TypeVar("AnyPoints", bound=Points)


def draw_map(points: Points, outcomes: Outcomes, bodies: Sequence[BodyLook] = (), *, speed: str | None) -> go.Figure:
    """Draw places from above, coloured by the speed of this name, or by outcome."""
    figure = draw_coloured(
        points,
        outcomes,
        columns=("x_m", "y_m", "speed_mps"),
        hover="x %{x:.3f} m, y %{y:.3f} m" + (f", {speed} %{{marker.color:.2f}} m/s" if speed is not None else ""),
        scale_title=None if speed is None else f"{speed} [m/s]",
    )
    draw_bodies(figure, bodies, "above_m")
    robot = {"symbol": "star-triangle-up", "size": 13, "color": NEUTRAL, "line": {"width": 1, "color": "white"}}
    figure.add_scatter(x=[0], y=[0], mode="markers", name="robot", marker=robot, hovertemplate="robot<extra></extra>")
    figure.update_xaxes(title="x, forward [m]", constrain="domain")
    figure.update_yaxes(title="y, left [m]", scaleanchor="x", constrain="domain")
    return figure.update_layout(height=460)


def draw_bodies(figure: go.Figure, bodies: Sequence[BodyLook], outline: str) -> None:
    """Draw one of the outlines of bodies behind all that a figure shows; the more of a name, the paler each is."""
    shown, same = len(figure.data), Counter(body.name for body in bodies)
    for body in bodies:
        first, *others = getattr(body, outline)
        x, y = zip(first, *others, first, strict=True)
        red, green, blue = bytes.fromhex(body.color[1:])
        fill = f"rgba({red}, {green}, {blue}, {0.2 / same[body.name]:.3f})"
        look = {"mode": "lines", "fill": "toself", "fillcolor": fill, "line": {"color": body.color, "width": 1}}
        figure.add_scatter(x=x, y=y, **look, name=body.name, showlegend=False, hoverinfo="skip")
    figure.data = (*figure.data[shown:], *figure.data[:shown])


def draw_coloured(
    points: Points, outcomes: Outcomes, *, columns: tuple[str, str, str], hover: str, scale_title: str | None
) -> go.Figure:
    """Draw points in one colour scale, or without its title in the colours of outcomes; each of these has a marker."""
    shown = points[choose_points(len(points))]
    x, y, colour = (getattr(shown, name) for name in columns)
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
                hovertemplate=f"trial %{{customdata}}<br>{hover}<extra>{in_words(name)}</extra>",
            )
        )
    # The legend has markers of its own, because the points have no single colour.
    for _, name in present:
        style = outcomes.style_of(name)
        look = {"symbol": style.symbol, "color": style.colour if scale_title is None else NEUTRAL}
        if scale_title is not None and name != outcomes.success:
            look = {"symbol": f"{style.symbol}-open", "color": style.colour}
        figure.add_scatter(x=[None], y=[None], mode="markers", name=in_words(name), marker={**look, "size": 9})
    axis = {} if scale_title is None else {"colorscale": SCALE, "colorbar": colour_bar(scale_title)}
    return figure.update_layout(coloraxis=axis, legend=LEGEND_ABOVE)


def colour_bar(title: str) -> dict[str, object]:
    """Describe the bar that explains a scale of colours."""
    return {"title": {"text": title, "side": "right"}, "thickness": 12, "outlinewidth": 0}
