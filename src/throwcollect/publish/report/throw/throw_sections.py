"""The sections that the task of throwing adds to a report: landings, releases and flights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
import plotly.graph_objects as go
import pyarrow as pa
from numpy.typing import NDArray

from throwcollect.config.sweep import LANDING_HEIGHT, TargetConfig
from throwcollect.config.values import column_of
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.contents import Panel, ReportSection, TaskReport
from throwcollect.publish.report.figures import BLUE, SCALE, Points, colour_bar, draw_coloured, draw_map, place_bars
from throwcollect.publish.report.measured import MOST_POINTS, Outcomes, read_numbers
from throwcollect.publish.report.throw.flights import measure_residuals, show_physics
from throwcollect.robots.surroundings import BodyLook, looks_of
from throwcollect.wording import format_count

_FEW = 8
"""Up to this many throws in a cell, the scale has a mark for each number of throws; plotly would also mark halves."""
_BINS = 14
_EXAMPLES = 9
"""Throws whose bodies are drawn."""
_TITLES = {
    "distance_m": ("landing distance", "landing distance [m]"),
    "hit_angle_rad": ("hit angle", "hit angle below the horizontal [°]"),
    "height_m": ("landing height", "landing height [m]"),
}
"""Name of each dimension, and the label of its axis."""


def report_throws(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of a report that only datasets of throws have."""
    throws = dataset.throws
    landings = Points.read(throws, outcomes, "landing", None, "release_speed_mps")
    planned = landings[outcomes.are(outcomes.success)[landings.row]]
    few = dataset[:: -(-len(dataset) // _EXAMPLES)]
    bodies = tuple(dict.fromkeys(body for throw in few for body in looks_of(throw.config)[:-1]))
    target = dataset.config.sweep.target
    cells = tuple(_show_cells(planned, throws, target, outcomes.verbs[1])) if len(planned) else ()
    return TaskReport(
        tiles=planned.show_ranges("landing distance", "release speed"),
        sections=(
            _show_landings(landings, planned, outcomes, cells, bodies),
            _show_releases(landings, np.degrees(read_numbers(throws, "release_elevation_rad")[landings.row]), outcomes),
            show_physics(measure_residuals(dataset), len(dataset.recorded)),
        ),
    )


def _show_landings(
    landings: Points,
    planned: Points,
    outcomes: Outcomes,
    cells: tuple[Panel, ...],
    bodies: Sequence[BodyLook],
) -> ReportSection:
    """Show where balls crossed the landing plane; `planned` are those that were thrown as planned, also by `cells`."""
    title = "Where the balls land"
    if not len(landings):
        return ReportSection("landing", title, f"No ball crossed the {_name_plane(outcomes)}.")
    text = f"{outcomes.succeeded:,} of {len(outcomes.codes):,} throws {outcomes.verbs[1]}"
    if len(planned):
        if outcomes.success != "landed":
            text += f"; the balls crossed the {_name_plane(outcomes)}"
        x, y, distance = planned.x_m, planned.y_m, planned.distance_m
        text += f", {distance.min():.2f} to {distance.max():.2f} m from the robot: "
        text += f"x {x.min():.2f} to {x.max():.2f} m, y {y.min():.2f} to {y.max():.2f} m"
    others = len(landings) - len(planned)
    text += f". {format_count(others, 'further ball')} crossed the {_name_plane(outcomes)}, too." if others else "."
    # A landing is all that a throw is about, but only a part of what other tasks are about.
    figure = draw_map(landings, outcomes, bodies, speed="release speed" if outcomes.success == "landed" else None)
    notes = [_describe_choice(landings)]
    if len({body.name for body in bodies}) < len(bodies):
        notes.append("Bodies differ from throw to throw; those of a few throws are drawn.")
    above = Panel("map", "Landings from above", figure, " ".join(filter(None, notes)))
    return ReportSection("landing", title, text, ((above, *cells),))


def _show_cells(planned: Points, throws: pa.Table, target: TargetConfig | None, succeeded: str) -> Iterator[Panel]:
    """Show how many throws that succeeded there are in each cell; `succeeded` is what such a throw did, in words."""
    edges, counts = count_throws(planned, throws, target=target)
    names, others = list(edges), len(planned) - int(counts.sum())
    text = f"{(counts > 0).sum():,} of {counts.size:,} cells have a throw that {succeeded}, at most {counts.max():,}"
    text += "." if target is None else f"; {others:,} landed in no cell."
    if len(names) == 1:
        hover = "near %{x:.3f}: %{y} throws<extra></extra>"
        bars = place_bars(edges[names[0]])
        figure = go.Figure(go.Bar(**bars, y=counts, marker_color=BLUE, hovertemplate=hover))
        figure.update_xaxes(title=_TITLES[names[0]][1], showgrid=False).update_yaxes(title="throws")
        yield Panel("cells", "Throws by target", figure.update_layout(height=460, bargap=0), text)
    # Each pair of axes, with the throws summed over the third.
    for number, (first, second) in enumerate(combinations(range(len(names)), 2)):
        over = counts.sum(axis=tuple({*range(len(names))} - {first, second}))
        pair = {name: edges[name] for name in (names[first], names[second])}
        title = f"{'Throws by' if target is None else 'Targets:'} {' and '.join(_TITLES[name][0] for name in pair)}"
        yield Panel(f"cells-{number}", title, draw_coverage_map(pair, over), "" if number else text)


def _show_releases(landings: Points, elevation_deg: NDArray[np.float64], outcomes: Outcomes) -> ReportSection:
    """Show speed and direction of flight at release, above the horizontal."""
    title = "How the balls are released"
    if not len(landings):
        return ReportSection("release", title, f"No ball crossed the {_name_plane(outcomes)}.")
    middle = np.median(elevation_deg)
    text = (
        f"Of the balls that crossed the {_name_plane(outcomes)}, the median speed is "
        f"{np.median(landings.speed_mps):.2f} m/s, the median direction {abs(middle):.1f}° "
        f"{'below' if middle < 0 else 'above'} the horizontal."
    )
    figure = draw_coloured(
        landings,
        outcomes,
        (landings.speed_mps, elevation_deg, landings.distance_m),
        hover="%{x:.2f} m/s at %{y:.1f}°, landed at %{marker.color:.3f} m",
        scale_title="landing distance [m]",
    )
    figure.update_xaxes(title="release speed [m/s]").update_yaxes(title="release elevation [°]")
    panel = Panel("map", "Speed and elevation at release", figure.update_layout(height=420), _describe_choice(landings))
    return ReportSection("release", title, text, ((panel,),))


def _describe_choice(landings: Points) -> str:
    count = len(landings)
    return f"{MOST_POINTS:,} of {count:,} throws, chosen at random." if count > MOST_POINTS else ""


def _name_plane(outcomes: Outcomes) -> str:
    return "landing plane" if outcomes.success == "landed" else "plane of the rim"


def count_throws(
    landings: Points, throws: pa.Table, *, target: TargetConfig | None
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.intp]]:
    """Count throws that landed in the cells of the configuration's targets, one to three dimensions.

    Without targets, the cells span the values of the throws, of which there is one. The table is that of all throws.

    Returns:
        The edges of each dimension by its name, shape ``(n_bins + 1,)``, and the number of throws in each cell; angles
        are in degrees.
    """
    angle = np.degrees(read_numbers(throws, "hit_angle_rad"))[landings.row]
    values = {"distance_m": landings.distance_m, "hit_angle_rad": angle}
    if target is None:
        edges = {name: np.histogram_bin_edges(column, _BINS) for name, column in values.items()}
    else:
        if target.height_m is not None:
            # The column has the heights of all trials, but only trials with landings matter here.
            values["height_m"] = read_numbers(throws, column_of(LANDING_HEIGHT))[landings.row]
        bins = target.dimensions
        edges = {
            name: np.linspace(bins[name].min, bins[name].max, bins[name].bins + 1) for name in values if name in bins
        }
        if "hit_angle_rad" in edges:
            # The configuration has radians, but the axis and the values above are in degrees.
            edges["hit_angle_rad"] = np.degrees(edges["hit_angle_rad"])
    counts, _ = np.histogramdd(np.column_stack([values[name] for name in edges]), list(edges.values()))
    return edges, counts.astype(np.intp)


def draw_coverage_map(edges: Mapping[str, NDArray[np.float64]], counts: NDArray[np.intp]) -> go.Figure:
    """Draw the number of throws over two dimensions of the cells; empty cells are blank."""
    (first, x), (second, y) = edges.items()
    most = max(int(counts.max()), 1)
    marks = {"dtick": 1} if most <= _FEW else {}
    figure = go.Figure(
        go.Heatmap(
            x=x,
            y=y,
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
    figure.update_xaxes(title=_TITLES[first][1], showgrid=False)
    figure.update_yaxes(title=_TITLES[second][1], showgrid=False)
    return figure.update_layout(height=460)
