"""What a page is made of."""

from __future__ import annotations

from dataclasses import dataclass

import plotly.graph_objects as go


@dataclass(frozen=True)
class Panel:
    """A figure with its caption.

    Attributes:
        key: Its name within the section.
        title: What one sees, as text.
        figure: The figure.
        text: More about it, as HTML.
        width_px: Width below which it scrolls [px]; 0: it shrinks with the page.
        small: Whether a third of the page is enough for it.
    """

    key: str
    title: str
    figure: go.Figure
    text: str = ""
    width_px: int = 0
    small: bool = False


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        key: Its name in links.
        short: Its name in the table of contents.
        title: What one sees, as text.
        text: What it comes to, as HTML.
        blocks: Below one another: HTML, a figure, or figures side by side.
    """

    key: str
    short: str
    title: str
    text: str
    blocks: tuple[str | Panel | tuple[Panel, ...], ...] = ()
