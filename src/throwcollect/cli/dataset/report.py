"""`throwcollect dataset report`: a page on a dataset, and pictures for papers."""

from __future__ import annotations

import json as jsonlib
from pathlib import Path

import typer

from throwcollect.report.write import write_report


def report_dataset(directory: Path, output: Path | None, *, pictures: Path | None, json: bool) -> None:
    """Write a report and print where it is.

    Args:
        directory: Directory of the dataset.
        output: HTML file to write; when None, beside the dataset and named like it.
        pictures: Directory for pictures; when None, none are drawn.
        json: Whether to print JSON.

    Raises:
        ConfigError: If what draws is not installed, or a file is there already.
        DatasetError: If the directory holds no finished dataset, it is damaged, or the report cannot be written.
    """
    resolved = directory.resolve()
    page = output or resolved.with_name(f"{resolved.name}.html")
    written = write_report(directory, page, pictures=pictures)
    size = written.page.stat().st_size
    if json:
        found = {"page": str(written.page), "size_bytes": size, "pictures": [str(path) for path in written.pictures]}
        typer.echo(jsonlib.dumps(found, indent=2))
        return
    typer.echo(f"{written.page}: {size / 1e6:.1f} MB")
    for path in written.pictures:
        typer.echo(str(path))
