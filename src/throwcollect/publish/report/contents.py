"""The parts of a report before they become a page, and amounts as people write them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go


@dataclass(frozen=True)
class Panel:
    """A figure with its caption.

    Attributes:
        key: Its name within the section.
        title: Short title, as text.
        figure: The figure, with its height.
        text: Caption, as text.
        width_px: Width below which it scrolls [px]; with 0, it shrinks with the page instead.
        small: True if a third of the width of the page is enough.
    """

    key: str
    title: str
    figure: go.Figure
    text: str = ""
    width_px: int = 0
    small: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        rows: Text of each cell; `markupsafe.Markup` for HTML.
        head: Titles of the columns; empty for a table whose first column has the titles of the rows.
        number_columns: Columns of numbers, which are aligned at the right.
    """

    rows: tuple[Sequence[str], ...]
    head: tuple[str, ...] = ()
    number_columns: tuple[int, ...] = ()


@dataclass(frozen=True)
class Listing:
    """Name and text of a file, which unfolds at a click."""

    name: str
    text: str


Row = tuple[Panel, ...]
"""Panels side by side."""


@dataclass(frozen=True)
class ReportSection:
    """A part of the page.

    Attributes:
        key: Its name in links and, with a capital letter, in the table of contents.
        title: Its subject, as text.
        text: Its summary, as text; `markupsafe.Markup` for HTML.
        blocks: Below one another; a string is a paragraph.
    """

    key: str
    title: str
    text: str
    blocks: tuple[Row | Table | Listing | str, ...] = ()


Tile = tuple[str, str]
"""A key number of the dataset, with its unit, and the label below it."""


@dataclass(frozen=True)
class TaskReport:
    """The part of a report that the task of its trials adds.

    Attributes:
        tiles: Key numbers, which follow how many trials there are and succeeded.
        sections: Sections on the results of the trials, which open the page.
    """

    tiles: tuple[Tile, ...] = ()
    sections: tuple[ReportSection, ...] = ()


def format_share(count: int, total: int) -> str:
    """A share in percent; only all is 100 % and only none is 0 %."""
    percent = 100 * count / total
    if 0 < count < total:
        percent = min(max(percent, 0.1), 99.9)
    return f"{percent:.3g} %" if percent in (0, 100) else f"{percent:.1f} %"


def format_duration(seconds: float) -> str:
    """A time in seconds, minutes or hours."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"


def format_size(count: int) -> str:
    """A number of bytes in kB, MB or GB."""
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size:
            return f"{count / size:.1f} {unit}"
    return f"{count / 1e3:.0f} kB"
