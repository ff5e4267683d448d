"""Makes the part of a report that the task adds; that of another package is checked before it becomes a page."""

from __future__ import annotations

import json
from collections.abc import Iterator

import plotly.graph_objects as go

from throwcollect.dataset.reader import Dataset
from throwcollect.members import explain_failure, is_own, load_part
from throwcollect.report.amounts import format_share
from throwcollect.report.contents import Listing, Panel, ReportSection, Table, TaskReport, Tile
from throwcollect.report.outcomes import Outcomes, in_words
from throwcollect.robots.description import robot_of
from throwcollect.tasks.task import task_of


def report_task(dataset: Dataset, outcomes: Outcomes) -> TaskReport:
    """Make the part of the task; for a task without one, numbers of trials and of those that succeeded.

    Raises:
        ConfigError: If the task comes from another package, and its function cannot be imported.
        MemberError: If the task comes from another package, and its function fails or returns something wrong.
    """
    name = dataset.config.task.name
    if path := task_of(dataset.config).report:
        report = load_part("tasks", name, path)
        with explain_failure("tasks", name, "report its trials"):
            added: TaskReport = report(dataset, outcomes)
            if not is_own("tasks", name):
                _check_part(added)
        return added
    trials = len(outcomes.codes)
    tiles = (
        Tile(f"{trials:,}", "trials planned"),
        Tile(format_share(outcomes.succeeded, trials), in_words(outcomes.success)),
    )
    by = robot_of(dataset.config).introduction
    return TaskReport(f"simulated {dataset.config.task.subject} by {by}", tiles, results=(), episodes=())


def find_repeated(sections: tuple[ReportSection, ...]) -> str | None:
    """Find a name that two sections have, so that links to them would lead to the first; None if there is none."""
    names = [section.key for section in sections]
    return next((name for name in names if names.count(name) > 1), None)


def _check_part(added: object) -> None:
    """Make sure that a page can be made of what the function of a task returned.

    Raises:
        TypeError: If anything in it is wrong.
    """
    if (wrong := next(_find_mistakes(added), None)) is not None:
        raise TypeError(wrong)


def _find_mistakes(added: object) -> Iterator[str]:
    """Say what is wrong with what the function of a task returned, one sentence each."""
    if not isinstance(added, TaskReport):
        yield f"its function should return a TaskReport, returned {added!r}"
        return
    if not isinstance(added.subject, str):
        yield f"subject should be a text, is {added.subject!r}"
    for name, kind in (("tiles", Tile), ("results", ReportSection), ("episodes", ReportSection)):
        values = getattr(added, name)
        if not isinstance(values, tuple) or not all(isinstance(each, kind) for each in values):
            yield f"{name} should be a tuple of {kind.__name__}, is {values!r}"
            return
    for section in (*added.results, *added.episodes):
        for block in section.blocks:
            if isinstance(block, tuple):
                yield from (f"the section {section.key}: {wrong}" for wrong in _find_mistakes_of_row(block))
            elif not isinstance(block, Table | Listing | str):
                yield (
                    f"the section {section.key}: a block should be a tuple of Panel, a Table, a Listing or a text, "
                    f"is {block!r}"
                )


def _find_mistakes_of_row(row: tuple[object, ...]) -> Iterator[str]:
    for panel in row:
        if not isinstance(panel, Panel):
            yield f"a row should be a tuple of Panel, has {panel!r}"
        elif not isinstance(panel.figure, go.Figure):
            yield f"the figure of the panel {panel.key} should be a plotly.graph_objects.Figure, is {panel.figure!r}"
        else:
            try:
                json.dumps(panel.figure.to_dict(), allow_nan=False, default=list)
            except ValueError:
                yield f"the figure of the panel {panel.key} has numbers that are not finite; use None for a gap"
