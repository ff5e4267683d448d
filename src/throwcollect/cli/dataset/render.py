"""`throwcollect dataset render`: an animated picture of a throw."""

from __future__ import annotations

import json as jsonlib
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption


def render_dataset(
    directory: DatasetArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Picture to write: .webp or .gif.")],
    trial: Annotated[
        int | None,
        typer.Option("--trial", metavar="K", help="Number of the trial; the first recorded one if not given."),
    ] = None,
    slow: Annotated[
        float, typer.Option("--slow", metavar="FACTOR", min=0.5, max=20, help="How many times slower than it was.")
    ] = 1.0,
    json: JsonOption = False,
) -> None:
    """Draw a throw as an animated picture, from what was recorded."""
    from throwcollect.view.animation import render

    written = render(directory, output, trial=trial, slow=slow)
    if json:
        typer.echo(jsonlib.dumps({**vars(written), "file": str(written.file)}, indent=2))
        return
    typer.echo(
        f"{written.file}: trial {written.trial}, {written.pictures} pictures, {written.duration_s:.1f} s, "
        f"{written.size_bytes / 1e6:.2f} MB"
    )
