"""The sections that the task of pushing a puck adds to a report: where pucks rest, and how far they slide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.values import column_of, leaves
from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.contents import Panel, ReportSection, TaskReport
from throwcollect.publish.report.figures import LIMIT_LINE, Points, draw_coloured, draw_map, single_precision
from throwcollect.publish.report.measured import Outcomes, read_numbers
from throwcollect.robots.surroundings import looks_of
from throwcollect.wording import format_count

_BRAKES = ("task.table.friction", "task.puck.friction", "scene.gravity_mps2")
"""Keys whose product is the deceleration of a sliding puck [m/s²]."""


def report_slides(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of a report that only datasets of slides have."""
    throws = dataset.throws
    slides = Points.read(throws, outcomes, "rest", "slide_distance_m", "puck_speed_mps")
    fixed = {leaf.name: leaf.value for leaf in leaves(dataset.config) if leaf.name in _BRAKES}
    braking = np.ones(len(throws))
    for key in _BRAKES:
        braking = braking * (read_numbers(throws, column_of(key)) if key in dataset.plan.keys else fixed[key])
    results = (_show_rests(dataset, slides, outcomes), _show_distances(slides, braking[slides.row], outcomes))
    return TaskReport(slides.show_ranges("slide distance", "speed after the push"), results)


def _show_rests(dataset: Dataset, slides: Points, outcomes: Outcomes) -> ReportSection:
    title = "Where the pucks rest"
    if not len(slides):
        return ReportSection("rest", "Rests", title, "No puck left the tool and came to rest on the table.")
    x, y = slides.x_m, slides.y_m
    text = (
        f"{outcomes.succeeded:,} of {len(outcomes.codes):,} pucks {outcomes.verbs[1]} after one push. "
        f"{format_count(len(slides), 'puck')} in all slid and came to rest: "
        f"x {x.min():.2f} to {x.max():.2f} m, y {y.min():.2f} to {y.max():.2f} m."
    )
    figure = draw_map(slides, outcomes, looks_of(dataset.config), speed="speed after the push")
    note = "The table, and the puck before the push, are those of the configuration."
    return ReportSection("rest", "Rests", title, text, ((Panel("map", "Rests from above", figure, note),),))


def _show_distances(slides: Points, braking: NDArray[np.float64], outcomes: Outcomes) -> ReportSection:
    """Compare distances with those that follow from Coulomb friction, whose deceleration [m/s²] is given."""
    title = "Whether slides obey Coulomb's law"
    if not len(slides):
        return ReportSection("distance", "Distances", title, "No puck left the tool and came to rest on the table.")
    # Without friction, nothing comes to rest, so there is no slide.
    predicted = slides.speed_mps**2 / (2 * braking)
    figure = draw_coloured(
        slides,
        outcomes,
        (slides.speed_mps, slides.distance_m, predicted),
        hover="left at %{x:.2f} m/s, slid %{y:.3f} m",
        scale_title=None,
    )
    speeds = np.linspace(0.0, float(slides.speed_mps.max()), 50)
    for braking_mps2 in {float(braking.min()), float(braking.max())}:
        figure.add_scatter(
            x=single_precision(speeds),
            y=single_precision(speeds**2 / (2 * braking_mps2)),
            mode="lines",
            line=LIMIT_LINE,
            showlegend=False,
            hovertemplate=f"µ g = {braking_mps2:.2f} m/s²<extra></extra>",
        )
    figure.update_xaxes(title="speed after the push [m/s]").update_yaxes(title="slide distance [m]")
    off = np.abs(slides.distance_m - predicted)
    varies = "; they vary, so these are the lines of the least and the greatest" if np.ptp(braking) else ""
    text = (
        f"Dashed: v²/(2 µ g), where µ is the product of the frictions of table and puck{varies}. "
        f"Half of the distances differ from it by less than {1000 * np.median(off):.1f} mm, 9 of 10 by less than "
        f"{1000 * np.quantile(off, 0.9):.1f} mm; a puck that hits something else slides less far."
    )
    panel = Panel("law", "Distance over speed", figure.update_layout(height=420))
    return ReportSection("distance", "Distances", title, text, ((panel,),))
