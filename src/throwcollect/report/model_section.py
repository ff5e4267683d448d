"""The section of a report on a model of the dataset: targets, how they are missed, and what adapting changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from throwcollect.config.task_config import TaskConfig
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.learning.model import Model, load_model, read_score
from throwcollect.learning.score import SCORE_HEAD, Errors, MissStatistics, Score, ThrowAtTarget, format_length
from throwcollect.report.contents import Panel, ReportSection, Row, Table
from throwcollect.report.figures import BLUE, LEGEND_ABOVE
from throwcollect.report.targets import choose_scale, draw_miss_map, title_column, title_misses
from throwcollect.units import choose_shown_unit
from throwcollect.wording import command, format_count

_TITLE = "How a model of it hits"
_NOUNS = {"m": "distance", "rad": "angle"}
"""Words for the difference between a throw and its target, by unit."""


def show_model(directory: Path, dataset: Dataset) -> ReportSection:
    """Show how a model of a dataset hits targets, from the directory of the model."""
    model, score = load_model(directory), read_score(directory)
    trained = model.trained_on
    if trained.digest != dataset.digest:
        raise ConfigError(
            f"{directory}: was learned from {trained.name}, digest {trained.digest[:10]}",
            expected=f"a model of this dataset, digest {dataset.digest[:10]}",
            hint=command("fit", dataset.directory, "-o", "MODEL"),
        )
    error = format_length(trained.error, model.targets)
    text = (
        f"Learned from {trained.throws:,} throws: {', '.join(model.parameters)} to {', '.join(model.targets)}. "
        f"Throws that polynomials were not fitted to are predicted to {error} (median)."
    )
    if score is None:
        hint = command("score", directory)
        return ReportSection(
            "model", "Model", _TITLE, f"{text} Nobody has thrown with it yet; {hint} does, in simulation."
        )
    seeds = format_count(score.seeds, "seed")
    text += f" Misses are medians of {seeds}, of {score.targets} targets each, in simulation."
    panels = [
        _show_misses("targets", "Targets", model, score.throws, dataset.config.task),
        *_show_errors(
            "training",
            "Misses by number of throws learned from",
            [(each.trained_on, each.errors) for each in score.trained],
            x={"title": "throws learned from", "type": "log"},
            y={"type": "log"},
        ),
    ]
    rows: list[Row | Table] = [tuple(panels), _tabulate(score)]
    if score.adapted:
        shown = "Targets there after the last of them"
        there = _show_misses("elsewhere", shown, model, score.adapted_throws, dataset.config.task)
        errors = _show_errors(
            "adapting",
            "In another world, by number of throws there",
            [(each.real_throws, each.errors) for each in score.adapted],
            x={"title": "throws in the other world"},
            y={"rangemode": "tozero"},
        )
        rows.append((*errors, there))
    return ReportSection("model", "Model", _TITLE, text, tuple(rows))


def _show_misses(key: str, shown: str, model: Model, throws: Sequence[ThrowAtTarget], task: TaskConfig) -> Panel:
    """Show targets amid the places that the dataset reached, and a line for each miss."""
    shape, nowhere = (len(throws), len(model.targets)), [np.nan] * len(model.targets)
    targets = np.array([throw.target for throw in throws], np.float64).reshape(shape)
    places = np.array([throw.place or nowhere for throw in throws], np.float64).reshape(shape)
    titles = [title_column(column, task) for column in model.targets]
    times = choose_scale(targets, places)
    figure = draw_miss_map(model.learned.outputs, targets, places, titles, task, times=times)
    return Panel(key, title_misses(shown, times), figure)


def _show_errors(
    key: str, title: str, errors: Sequence[tuple[int, Errors]], *, x: dict[str, str], y: dict[str, str]
) -> Iterator[Panel]:
    """Make a panel for each unit of misses by a number of throws; x and y are settings of its axes."""
    throws = [count for count, _ in errors]
    for number, misses in enumerate(zip(*(each.by_unit for _, each in errors), strict=True)):
        figure = _draw_errors(throws, misses).update_xaxes(x).update_yaxes(y)
        yield Panel(f"{key}-{misses[0].unit}" if number else key, title, figure)


def _draw_errors(numbers: Sequence[int], misses: Sequence[MissStatistics]) -> go.Figure:
    """Draw median and ninth decile of misses of one unit over a number of throws."""
    factor, unit = choose_shown_unit(misses[0].unit)
    figure = go.Figure()
    # The legend has room for a marker, but hardly for a dash: so the markers differ, too.
    for name, symbol, values, look in (
        ("median", "circle", [each.median for each in misses], {"width": 2}),
        ("9 of 10 below", "circle-open", [each.share90 for each in misses], {"width": 1.5, "dash": "dash"}),
    ):
        scaled = [None if value is None else value * factor for value in values]
        marker, line = {"color": BLUE, "size": 5, "symbol": symbol}, {"color": BLUE, **look}
        figure.add_scatter(x=list(numbers), y=scaled, mode="lines+markers", line=line, marker=marker, name=name)
    title = f"{_NOUNS.get(misses[0].unit, 'difference')} from the target [{unit}]"
    return figure.update_yaxes(title=title).update_layout(height=420, legend=LEGEND_ABOVE)


def _tabulate(score: Score) -> Table:
    return Table(head=("", *SCORE_HEAD), rows=tuple(score.list_rows()), number_columns=(1, 2, 3, 4, 5))
