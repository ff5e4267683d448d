"""The section of a report on the targets of trials: where they should end, and by how much they missed."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.config.values import column_of
from throwcollect.dataset.misses import read_targets, summarise_misses
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.summary import MissSummary
from throwcollect.report.contents import Panel, ReportSection, Table
from throwcollect.report.figures import BLUE
from throwcollect.report.miss_map import choose_scale, draw_miss_map, title_misses
from throwcollect.report.plotted_points import choose_points, read_numbers
from throwcollect.sweep.points import Targets
from throwcollect.units import choose_shown_unit, unit_of_name
from throwcollect.wording import format_count

_TITLE = "How targets are missed"


def show_targets(dataset: Dataset) -> tuple[ReportSection, ...]:
    """Show the targets of trials; nothing if they have none."""
    targets = read_targets(dataset.throws)
    if targets is None:
        return ()
    misses = summarise_misses(dataset.config, dataset.throws)
    targeted = int((~np.isnan(targets.values)).any(axis=1).sum())
    said = [
        "{}: median {}, 9 of 10 below {}".format(name, *each.format_misses(unit_of_name(name))[:2])
        for name, each in misses.items()
        if each.measured
    ]
    text = f"{targeted:,} of {format_count(len(dataset.throws), dataset.config.task.noun)} should end at a target. "
    text += f"{'; '.join(said)}, in simulation." if said else "None of them ended anywhere."
    panels = [
        _show_map(dataset, targets),
        *(
            Panel(name, f"Share of misses below a distance: {name}", _draw_share(dataset, name), picture=name)
            for name, each in misses.items()
            if each.measured
        ),
    ]
    return (ReportSection("misses", "Targets", _TITLE, text, (tuple(panels), _tabulate(misses))),)


def _show_map(dataset: Dataset, targets: Targets) -> Panel:
    """Show the first two columns of targets."""
    declared = {column.name: column for column in dataset.config.task.target_columns}
    throws, shown = dataset.throws, targets.names[:2]
    nowhere = np.full(len(throws), np.nan)
    sources = [column_of(declared[name].of) for name in shown]
    ends = [read_numbers(throws, name) if name in throws.column_names else nowhere for name in sources]
    chosen = choose_points(len(throws))
    goals, places = targets.values[chosen, : len(shown)], np.column_stack(ends)[chosen]
    aimed = ~np.isnan(goals).any(axis=1)
    titles = [f"{declared[name].word} [{unit_of_name(name)}]" for name in shown]
    times = choose_scale(goals[aimed], places[aimed])
    figure = draw_miss_map(places[~aimed], goals[aimed], places[aimed], titles, dataset.config.task, times=times)
    return Panel("map", title_misses("Targets", times), figure, picture="targets_and_misses")


def _draw_share(dataset: Dataset, miss: str) -> go.Figure:
    scale, unit = choose_shown_unit(unit_of_name(miss))
    values: NDArray[np.float64] = np.sort(dataset.throws[miss].drop_null().to_numpy()) * scale
    figure = go.Figure()
    chosen = choose_points(len(values))
    figure.add_scatter(
        x=values[chosen],
        # The values are sorted, so this share of them is not greater than the value at this index.
        y=(chosen + 1) / len(values),
        mode="lines+markers",
        line={"color": BLUE, "width": 2},
        marker={"color": BLUE, "size": 4, "symbol": "circle"},
    )
    figure.update_xaxes(title=f"distance from the target [{unit}]", rangemode="tozero")
    figure.update_yaxes(title="share of trials", range=[0, 1.02])
    return figure.update_layout(height=420, showlegend=False)


def _tabulate(misses: dict[str, MissSummary]) -> Table:
    rows = tuple(
        (
            name,
            f"{each.targets:,}",
            f"{each.measured:,}",
            *each.format_misses(unit_of_name(name)),
        )
        for name, each in misses.items()
    )
    head = ("", "with a target", "measured", "median", "9 of 10 below", "largest")
    return Table(head=head, rows=rows, number_columns=(1, 2, 3, 4, 5))
