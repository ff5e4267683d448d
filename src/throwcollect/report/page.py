"""Writes a report as one HTML page that needs no other file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError
from throwcollect.extras import require
from throwcollect.files import write_file
from throwcollect.report.contents import format_share
from throwcollect.report.outcomes import in_words
from throwcollect.report.sections import Report, report_dataset
from throwcollect.version import __version__


def write_report(directory: Path, page: Path, *, model: Path | None = None) -> None:
    """Write a report on a dataset, and on a model that was learned from it, into an HTML file that is new."""
    require("jinja2", "plotly")
    if page.exists():
        raise ConfigError(
            f"{page}: exists", expected="a file that is new", hint="choose another --output, or remove it"
        )
    write_file(page, render_page(report_dataset(Dataset.open(directory), model=model)).encode())


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
