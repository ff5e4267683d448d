"""Pictures for papers: panels of the page, drawn without a display."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from throwcollect.report.contents import Panel, Section
from throwcollect.report.painter import paint


def write_pictures(sections: Iterable[Section], directory: Path) -> tuple[Path, ...]:
    """Draw the panels that have the name of a picture, a PNG file in the directory for each name.

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
        path = directory / f"{name}.png"
        paint(panels, path)
        written.append(path)
    return tuple(written)
