"""Writes a report to files."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import new_directory, write_file


@dataclass(frozen=True)
class Written:
    """Files of a report: the page, and the PNG files of its pictures, if there are any."""

    page: Path
    pictures: tuple[Path, ...]


def write_report(directory: Path, page: Path, *, pictures: Path | None = None, model: Path | None = None) -> Written:
    """Write a report on a dataset, and on a model that was learned from it, if its directory is given.

    The page is an HTML file, which must not exist yet. `pictures` is a directory for pictures, which must not exist or
    must be empty; None for no pictures.
    """
    require("jinja2", "plotly", *(("matplotlib",) if pictures else ()))
    from throwcollect.report.page import render_page
    from throwcollect.report.sections import report_dataset

    if page.exists():
        raise ConfigError(
            f"{page}: exists", expected="a file that is new", hint="choose another --output, or remove it"
        )
    written: tuple[Path, ...] = ()
    # This block begins before the dataset is read, so that a directory that cannot be used is reported at once.
    with new_directory(pictures) if pictures else nullcontext() as unfinished:
        report = report_dataset(Dataset.open(directory), model=model)
        text = render_page(report).encode()
        if pictures and unfinished:
            from throwcollect.report.painter import write_pictures

            written = tuple(pictures / path.name for path in write_pictures(report.sections, unfinished))
        # Without the page, no pictures may stay either, because they would be in the way of the same command.
        write_file(_find_place(page, pictures, unfinished), text)
    return Written(page, written)


def _find_place(page: Path, pictures: Path | None, unfinished: Path | None) -> Path:
    """Find where to write the page: if it will lie among the pictures, in their directory while it is unfinished."""
    if pictures and unfinished and page.resolve().is_relative_to(pictures.resolve()):
        return unfinished / page.resolve().relative_to(pictures.resolve())
    return page
