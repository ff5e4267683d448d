"""`throwcollect dataset export`: a dataset in another format."""

from __future__ import annotations

import json as jsonlib
from dataclasses import asdict
from pathlib import Path

import typer

from throwcollect.export.formats import export
from throwcollect.wording import counted


def export_dataset(directory: Path, output: Path, *, to: str, rate_hz: int | None, json: bool) -> None:
    """Write a dataset in another format and print what was written.

    Raises:
        ConfigError: If the request is wrong.
        DatasetError: If the dataset cannot be read, or the output not be written.
    """
    exported = export(directory, output, to=to, rate_hz=rate_hz)
    if json:
        typer.echo(jsonlib.dumps(asdict(exported), indent=2))
        return
    typer.echo(
        f"{exported.directory}: {counted(exported.episodes, 'throw')} of {counted(exported.trials, 'trial')}, "
        f"{counted(exported.samples, 'sample')} at {exported.rate_hz} Hz, {exported.size_bytes / 1e6:.1f} MB"
    )
