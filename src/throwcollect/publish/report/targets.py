"""The sections of a report on how targets are missed: by the trials of the dataset, and by a model of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from throwcollect.config.task_config import TaskConfig
from throwcollect.config.values import column_of
from throwcollect.dataset.misses import read_targets, summarise_misses
from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.learning.model import Model, load_model, read_score
from throwcollect.learning.score import SCORE_HEAD, Errors, ThrowAtTarget, format_length
from throwcollect.publish.report.contents import Panel, ReportSection, Row, Table
from throwcollect.publish.report.figures import BLUE, LEGEND_ABOVE, LIMIT_LINE, NEUTRAL
from throwcollect.publish.report.measured import choose_points, read_numbers
from throwcollect.units import choose_shown_unit, unit_of_name
from throwcollect.wording import command, format_count

_MODEL_TITLE = "How a model of it hits"
_NOUNS = {"m": "distance", "rad": "angle"}
"""Words for the difference between a throw and its target, by unit."""

_MOST = 10_000
"""A miss is drawn at most this many times as long as it is."""


def choose_scale(targets: NDArray[np.float64], places: NDArray[np.float64]) -> int:
    """Choose how many times as long misses are drawn, so that they are seen: the largest power of ten that fits.

    It fits if the longest drawn miss is no longer than the targets are apart; the arrays are those of `draw_miss_map`.
    """
    if not len(targets):
        return 1
    targets, places = _take_two(targets), _take_two(places)
    hit = np.isfinite(places).all(axis=1)
    longest = float(np.abs(places[hit] - targets[hit]).max(initial=0.0))
    span = float(np.ptp(targets, axis=0).max())
    times = 1
    while longest and times < _MOST and 10 * times * longest <= span:
        times *= 10
    return times


def _show_miss_map(
    key: str,
    shown: str,
    ends: NDArray[np.float64],
    targets: NDArray[np.float64],
    places: NDArray[np.float64],
    columns: Sequence[str],
    task: TaskConfig,
) -> Panel:
    """Show targets amid the ends of other trials, and a line for each miss, in the first two columns.

    `ends` have the shape ``(n, n_columns)``. `targets`, and the `places` where the trials at these targets ended, have
    the shape ``(n_targets, n_columns)``; a place is NaN if its trial has no end. The title begins with `shown`.
    """
    times = choose_scale(targets, places)
    figure = go.Figure()
    ends, targets, places = map(_take_two, (ends, targets, places))
    if len(ends):
        grey = {"color": NEUTRAL, "size": 3, "opacity": 0.5, "symbol": "circle"}
        figure.add_scatter(x=ends[:, 0], y=ends[:, 1], mode="markers", marker=grey, name=f"{task.noun}s of the dataset")
    hit = np.isfinite(places).all(axis=1)
    missed = f"targets where no {task.noun} {task.success}"
    for own, name, colour in ((hit, "targets", BLUE), (~hit, missed, LIMIT_LINE["color"])):
        if own.any():
            marker = {"color": colour, "size": 7, "symbol": "cross"}
            figure.add_scatter(x=targets[own, 0], y=targets[own, 1], mode="markers", marker=marker, name=name)
    if hit.any():
        tips = targets[hit] + times * (places[hit] - targets[hit])
        x, y = (
            # None separates the lines from each other.
            [end for line in zip(starts.tolist(), ends.tolist(), strict=True) for end in (*line, None)]
            for starts, ends in zip(targets[hit].T, tips.T, strict=True)
        )
        line = {"color": LIMIT_LINE["color"], "width": 1.5}
        figure.add_scatter(x=x, y=y, mode="lines", line=line, name=f"misses × {times}" if times > 1 else "misses")
    first, second = [*columns, ""][:2]
    figure.update_xaxes(title=first).update_yaxes(title=second, scaleanchor="x")
    title = f"{shown}, and misses drawn {times:,} times as long" if times > 1 else f"{shown} and misses"
    return Panel(key, title, figure.update_layout(height=420, legend=LEGEND_ABOVE))


def _take_two(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The first two columns; if there is only one, a column of zeros after it."""
    return np.column_stack([points, np.zeros(len(points))])[:, :2]


def show_targets(dataset: Dataset) -> tuple[ReportSection, ...]:
    """Show the targets of trials; nothing if they have none."""
    targets = read_targets(dataset.throws)
    if not targets:
        return ()
    misses = summarise_misses(dataset.config, dataset.throws)
    targeted = int((~np.isnan(list(targets.values()))).any(axis=0).sum())
    text = f"{targeted:,} of {format_count(len(dataset.throws), dataset.config.task.noun)} should end at a target."
    rows = (
        (name, f"{each.targets:,}", f"{each.measured:,}", *each.format_misses(unit_of_name(name)))
        for name, each in misses.items()
    )
    head = ("", "with a target", "measured", "median", "9 of 10 below", "largest")
    table = Table(head=head, rows=tuple(rows), number_columns=(1, 2, 3, 4, 5))
    return (ReportSection("misses", "How targets are missed", text, ((_show_map(dataset, targets),), table)),)


def _show_map(dataset: Dataset, targets: Mapping[str, NDArray[np.float64]]) -> Panel:
    """Show the first two columns of targets."""
    declared = {column.name: column for column in dataset.config.task.target_columns}
    throws, shown = dataset.throws, tuple(targets)[:2]
    nowhere = np.full(len(throws), np.nan)
    sources = [column_of(declared[name].of) for name in shown]
    ends = [read_numbers(throws, name) if name in throws.column_names else nowhere for name in sources]
    chosen = choose_points(len(throws))
    goals, places = np.column_stack([targets[name][chosen] for name in shown]), np.column_stack(ends)[chosen]
    aimed = ~np.isnan(goals).any(axis=1)
    columns = [declared[name].of for name in shown]
    return _show_miss_map("map", "Targets", places[~aimed], goals[aimed], places[aimed], columns, dataset.config.task)


def show_model(directory: Path, dataset: Dataset) -> ReportSection:
    """Show how a model of a dataset hits targets, from the directory of the model."""
    model, score = load_model(directory), read_score(directory)
    trained, noun = model.trained_on, dataset.config.task.noun
    if trained.digest != dataset.digest:
        raise ConfigError(
            f"{directory}: was learned from {trained.name}, digest {trained.digest[:10]}",
            expected=f"a model of this dataset, digest {dataset.digest[:10]}",
            hint=command("fit", dataset.directory, "-o", "MODEL"),
        )
    error = format_length(model.error, model.targets)
    text = (
        f"Learned from {format_count(trained.throws, noun)}: {', '.join(model.parameters)} to "
        f"{', '.join(model.targets)}. "
        f"{noun.capitalize()}s that polynomials were not fitted to are predicted to {error} (median)."
    )
    if score is None:
        hint = command("score", directory)
        return ReportSection("model", _MODEL_TITLE, f"{text} It has no score yet; {hint} tries it in simulation.")
    seeds = format_count(score.seeds, "seed")
    text += f" Misses are medians of {seeds}, of {score.targets} targets each, in simulation."
    panels = [
        _show_misses("targets", "Targets", model, score.throws, dataset.config.task),
        *_show_errors(
            "training",
            f"Misses by number of {noun}s learned from",
            [(each.trained_on, each.errors) for each in score.trained],
            x={"title": f"{noun}s learned from", "type": "log"},
            y={"type": "log"},
        ),
    ]
    table = Table(head=("", *SCORE_HEAD), rows=tuple(score.list_rows()), number_columns=(1, 2, 3, 4, 5))
    rows: list[Row | Table] = [tuple(panels), table]
    if score.adapted:
        shown = "Targets there after the last of them"
        there = _show_misses("elsewhere", shown, model, score.adapted_throws, dataset.config.task)
        errors = _show_errors(
            "adapting",
            f"In another world, by number of {noun}s there",
            [(each.real_throws, each.errors) for each in score.adapted],
            x={"title": f"{noun}s in the other world"},
            y={"rangemode": "tozero"},
        )
        rows.append((*errors, there))
    return ReportSection("model", _MODEL_TITLE, text, tuple(rows))


def _show_misses(key: str, shown: str, model: Model, throws: Sequence[ThrowAtTarget], task: TaskConfig) -> Panel:
    """Show targets amid the places that the dataset reached, and a line for each miss."""
    shape, nowhere = (len(throws), len(model.targets)), [np.nan] * len(model.targets)
    targets = np.array([throw.target for throw in throws], np.float64).reshape(shape)
    places = np.array([throw.place or nowhere for throw in throws], np.float64).reshape(shape)
    return _show_miss_map(key, shown, model.outputs, targets, places, model.targets, task)


def _show_errors(
    key: str, title: str, errors: Sequence[tuple[int, Errors]], *, x: dict[str, str], y: dict[str, str]
) -> Iterator[Panel]:
    """Show median and ninth decile of misses by a number of throws, in a panel for each unit.

    x and y are settings of its axes.
    """
    throws = [count for count, _ in errors]
    for number, misses in enumerate(zip(*(each.by_unit for _, each in errors), strict=True)):
        name = misses[0].unit
        factor, unit = choose_shown_unit(name)
        figure = go.Figure()
        # The legend has room for a marker, but hardly for a dash: so the markers differ, too.
        for label, symbol, values, look in (
            ("median", "circle", [each.median for each in misses], {"width": 2}),
            ("9 of 10 below", "circle-open", [each.share90 for each in misses], {"width": 1.5, "dash": "dash"}),
        ):
            scaled = [None if value is None else value * factor for value in values]
            marker, line = {"color": BLUE, "size": 5, "symbol": symbol}, {"color": BLUE, **look}
            figure.add_scatter(x=throws, y=scaled, mode="lines+markers", line=line, marker=marker, name=label)
        figure.update_yaxes(title=f"{_NOUNS.get(name, 'difference')} from the target [{unit}]")
        figure.update_layout(height=420, legend=LEGEND_ABOVE).update_xaxes(x).update_yaxes(y)
        yield Panel(f"{key}-{name}" if number else key, title, figure)
