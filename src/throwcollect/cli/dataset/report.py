"""`throwcollect dataset report`: a page on a dataset, and pictures for papers."""

from __future__ import annotations

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption


def report_dataset(
    directory: DatasetArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", metavar="FILE", help="HTML file to write; DIR.html beside the dataset if not given."),
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option("--png", metavar="DIR", help="Also write the main plots as pictures; must be new or empty."),
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="MODEL", help="A model of the dataset, and how it hits.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write a page that shows what a dataset holds, and pictures for papers."""
    from throwcollect.report.write import write_report

    resolved = directory.resolve()
    page = output or resolved.with_name(f"{resolved.name}.html")
    written = write_report(directory, page, pictures=png, model=model)
    size = written.page.stat().st_size
    if json:
        found = {"page": str(written.page), "size_bytes": size, "pictures": [str(path) for path in written.pictures]}
        typer.echo(jsonlib.dumps(found, indent=2))
        return
    typer.echo(f"{written.page}: {size / 1e6:.1f} MB")
    for path in written.pictures:
        typer.echo(str(path))
