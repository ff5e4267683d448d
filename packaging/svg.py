"""Parts of the figures of the documents, as SVG that reads on light and on dark pages."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

STYLE = """
text { fill: #1c2733; }
.page { fill: #ffffff; }
.box { fill: #e3eefa; stroke: #34658f; }
.file { fill: #fdf3dc; stroke: #a67c1a; }
.ground { fill: #eef1f4; stroke: #9aa8b5; }
.arrow { stroke: #5b7083; fill: none; stroke-width: 1.2; }
.tip { fill: #5b7083; }
.words { font-size: 10.5px; fill: #45525f; }
.library { font-size: 10.5px; fill: #a8470b; }
.label { font-size: 10.5px; fill: #45525f; stroke: #ffffff; stroke-width: 4; paint-order: stroke; }
.title { font-size: 13px; font-weight: bold; }
@media (prefers-color-scheme: dark) {
text { fill: #e6edf3; }
.page { fill: #1e2129; }
.box { fill: #24405c; stroke: #7fb2e0; }
.file { fill: #4a3d1c; stroke: #d9b25a; }
.ground { fill: #2b303b; stroke: #66717d; }
.arrow { stroke: #9fb1c1; }
.tip { fill: #9fb1c1; }
.words { fill: #b9c5d0; }
.library { fill: #ffb07a; }
.label { fill: #b9c5d0; stroke: #1e2129; }
}
"""


def figure(width: float, height: float, parts: Iterable[str], *, script: str) -> str:
    """A whole SVG file.

    Args:
        width: In the units of its parts, as `height`.
        height: See `width`.
        parts: What is drawn, first what lies below.
        script: Who writes it.
    """
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" '
        'font-size="12" text-anchor="middle">',
        f"<!-- Written by packaging/{script}. -->",
        f"<style>{STYLE}</style>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" '
        'orient="auto-start-reverse"><path class="tip" d="M0 0 L8 4 L0 8 z"/></marker></defs>',
        '<rect class="page" width="100%" height="100%"/>',
        *parts,
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def rectangle(x: float, y: float, width: float, height: float, kind: str) -> str:
    """A rectangle around a point."""
    place = f'x="{x - width / 2:g}" y="{y - height / 2:g}" width="{width:g}" height="{height:g}"'
    return f'<rect class="{kind}" {place} rx="6"/>'


def line(x: float, y: float, to_x: float, to_y: float, *, both: bool = False) -> str:
    """An arrow, with a tip at its start, too, if it goes both ways."""
    start = ' marker-start="url(#tip)"' if both else ""
    return (
        f'<line class="arrow" x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}"{start} marker-end="url(#tip)"/>'
    )


def text(x: float, y: float, words: str, kind: str = "", *, anchor: str = "middle") -> str:
    """One line of text."""
    at = "" if anchor == "middle" else f' text-anchor="{anchor}"'
    return f'<text class="{kind}" x="{x:g}" y="{y:g}"{at}>{escape(words)}</text>'
