"""Writes a report to files: one page, and pictures."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import new_directory, write_file
from throwcollect.report.contents import format_share
from throwcollect.report.outcomes import in_words
from throwcollect.report.sections import Report
from throwcollect.version import __version__


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


def render_page(report: Report) -> str:
    """HTML of a report; equal reports give equal pages."""
    # All texts of a dataset are escaped; only `Markup` is HTML.
    templates = Environment(
        loader=PackageLoader("throwcollect.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Apart from numbers, texts and dictionaries, plotly leaves only sequences in a figure.
    templates.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False, "default": list}
    templates.filters |= {"specify": _specify, "in_words": in_words, "share": format_share}
    page = templates.get_template("page.html")
    return page.render(report=report, version=__version__, plotly=get_plotlyjs())


def _specify(figure: go.Figure) -> dict[str, Any]:
    """A figure as plotly's JavaScript reads it, without a theme: that of the page follows the reader's settings."""
    specification: dict[str, Any] = figure.to_dict()
    specification["layout"].pop("template", None)
    return specification
