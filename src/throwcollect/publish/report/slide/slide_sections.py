"""The section that the task of pushing a puck adds to a report: where pucks rest."""

from __future__ import annotations

from throwcollect.dataset.reader import Dataset
from throwcollect.publish.report.contents import Panel, ReportSection, TaskReport
from throwcollect.publish.report.figures import Points, draw_map
from throwcollect.publish.report.measured import Outcomes
from throwcollect.robots.surroundings import looks_of
from throwcollect.wording import format_count


def report_slides(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of a report that only datasets of slides have."""
    slides = Points.read(dataset.throws, outcomes, "rest", "slide_distance_m", "puck_speed_mps")
    tiles = slides.show_ranges("slide distance", "speed after the push")
    return TaskReport(tiles, (_show_rests(dataset, slides, outcomes),))


def _show_rests(dataset: Dataset, slides: Points, outcomes: Outcomes) -> ReportSection:
    title = "Where the pucks rest"
    if not len(slides):
        return ReportSection("rest", title, "No puck left the tool and came to rest on the table.")
    x, y = slides.x_m, slides.y_m
    text = (
        f"{outcomes.succeeded:,} of {len(outcomes.codes):,} pucks {outcomes.verbs[1]} after one push. "
        f"{format_count(len(slides), 'puck')} in all slid and came to rest: "
        f"x {x.min():.2f} to {x.max():.2f} m, y {y.min():.2f} to {y.max():.2f} m."
    )
    figure = draw_map(slides, outcomes, looks_of(dataset.config), speed="speed after the push")
    note = "The table, and the puck before the push, are those of the configuration."
    return ReportSection("rest", title, text, ((Panel("map", "Rests from above", figure, note),),))
