"""Pictures for papers: the panels of the page, one column wide and sharp in print, drawn without a display."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from throwcollect.report.contents import Panel, Section
from throwcollect.report.painter import paint

COLUMN_IN = 3.5
"""One column of a paper in two columns [in]."""
_BOTH_COLUMNS_IN = 7.16
_MOST_PX_IN_COLUMN = 405
"""Panels that need to be wider than this on the page get both columns."""
DPI = 300


def write_pictures(sections: Iterable[Section], directory: Path) -> tuple[Path, ...]:
    """Draw the panels that have the name of a picture, a PNG file each.

    Args:
        sections: Sections of a report.
        directory: Where the files go; it exists.

    Returns:
        The files that were written.

    Raises:
        OSError: If a file cannot be written.
    """
    pictures: dict[str, list[Panel]] = {}
    for section in sections:
        for panel in section.panels:
            if panel.picture:
                pictures.setdefault(panel.picture, []).append(panel)
    written = []
    for name, panels in pictures.items():
        wide = panels[0].width_px > _MOST_PX_IN_COLUMN
        path = directory / f"{name}.png"
        paint(panels, path, width_in=_BOTH_COLUMNS_IN if wide else COLUMN_IN, dpi=DPI)
        written.append(path)
    return tuple(written)
