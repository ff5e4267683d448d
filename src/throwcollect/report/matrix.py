"""All pairs of swept keys against each other, and each key by itself on the diagonal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from throwcollect.report.figures import NEUTRAL
from throwcollect.report.outcomes import Outcomes, in_words, style_of
from throwcollect.report.swept_keys import Parameter
from throwcollect.report.thinning import thinned

MOST_KEYS = 8
_MOST_POINTS = 8000
"""Points in all panels together, which a browser draws and redraws with ease."""
_PANEL_PX = 128
_GAP = 0.012


def parameter_matrix(parameters: Sequence[Parameter], outcomes: Outcomes) -> go.Figure:
    """Scatter plots below the diagonal, counts on it.

    Args:
        parameters: At most `MOST_KEYS`.
        outcomes: Outcomes of the trials.
    """
    count = len(parameters)
    chosen = thinned(len(outcomes.codes), points_of_panel(parameters))
    figure = go.Figure()
    for code, name in enumerate(outcomes.names):
        trials = chosen[outcomes.codes[chosen] == code]
        for row in range(1, count):
            for column in range(row):
                figure.add_trace(
                    go.Scatter(
                        x=parameters[column].values[trials].astype(np.float32),
                        y=parameters[row].values[trials].astype(np.float32),
                        customdata=trials,
                        xaxis=_name("x", column),
                        yaxis=_name("y", row),
                        mode="markers",
                        marker={
                            "color": style_of(name).colour,
                            "symbol": style_of(name).symbol,
                            "size": 4,
                            "opacity": 0.8,
                        },
                        name=in_words(name),
                        legendgroup=name,
                        showlegend=row == 1,
                        hovertemplate=f"trial %{{customdata}}<br>%{{x:.4g}}, %{{y:.4g}}<extra>{in_words(name)}</extra>",
                    )
                )
    for index, parameter in enumerate(parameters):
        figure.add_bar(
            x=(parameter.edges[:-1] + parameter.edges[1:]) / 2,
            width=np.diff(parameter.edges),
            y=parameter.counts.sum(axis=1),
            xaxis=_name("x", index),
            yaxis=_name("y", count + index),
            marker={"color": NEUTRAL, "opacity": 0.55},
            showlegend=False,
            hovertemplate="%{y} trials near %{x:.4g}<extra></extra>",
        )
    figure.update_layout(_axes(parameters))
    legend = {"x": 1, "y": 1, "xanchor": "right", "yanchor": "top"}
    return figure.update_layout(height=90 + _PANEL_PX * max(count, 2), bargap=0, legend=legend)


def points_of_panel(parameters: Sequence[Parameter]) -> int:
    """How many trials are drawn in each panel, at most."""
    return _MOST_POINTS // max(len(parameters) * (len(parameters) - 1) // 2, 4)


def width_of(parameters: Sequence[Parameter]) -> int:
    """Width below which the panels cannot be read [px]."""
    return 90 + 105 * len(parameters)


def _axes(parameters: Sequence[Parameter]) -> dict[str, object]:
    count = len(parameters)
    axes: dict[str, object] = {}
    for index, parameter in enumerate(parameters):
        across = [index / count + _GAP / 2, (index + 1) / count - _GAP / 2]
        down = [1 - across[1], 1 - across[0]]
        last, above = parameter.short_label
        title = {"text": f"{last}<br>{above}", "font": {"size": 10}}
        kind = {"type": "log", **parameter.ticks} if parameter.logarithmic else {}
        shared = {"title": title, "tickfont": {"size": 9}, "nticks": 4, "range": _range(parameter), **kind}
        # The axis of the lowest scatter plot in this column; the last column has none but its counts.
        below = "y" + str(count) if index < count - 1 else _name("y", count + index)
        axes[_key("x", index)] = {**shared, "domain": across, "anchor": below, "tickangle": 0}
        if index:
            axes[_key("y", index)] = {**shared, "domain": down, "anchor": "x"}
        counts = {"domain": down, "anchor": _name("x", index), "showticklabels": False, "showgrid": False}
        axes[_key("y", count + index)] = {**counts, "rangemode": "tozero"}
    return axes


def _range(parameter: Parameter) -> list[float]:
    ends = parameter.edges[[0, -1]]
    low, high = np.log10(ends) if parameter.logarithmic else ends
    room = 0.04 * (high - low)
    return [float(low - room), float(high + room)]


def _name(letter: str, index: int) -> str:
    """How a trace calls an axis."""
    return letter if index == 0 else f"{letter}{index + 1}"


def _key(letter: str, index: int) -> str:
    """How a layout calls it."""
    return f"{letter}axis" if index == 0 else f"{letter}axis{index + 1}"
