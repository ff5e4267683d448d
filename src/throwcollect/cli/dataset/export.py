"""`throwcollect dataset export`: a dataset in another format."""

from __future__ import annotations

import json as jsonlib
from dataclasses import asdict
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.wording import format_count


def export_dataset(
    directory: DatasetArgument,
    output: OutputArgument,
    to: Annotated[str, typer.Option("--to", metavar="parquet|npz|lerobot|hdf5|mat", help="Format.")],
    rate: Annotated[
        int | None, typer.Option("--rate", metavar="HZ", help="Samples per second; as recorded if not given.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write a dataset in another format, with a data card."""
    from throwcollect.export.formats import export

    exported = export(directory, output, to=to, rate_hz=rate)
    if json:
        typer.echo(jsonlib.dumps(asdict(exported), indent=2))
        return
    typer.echo(
        f"{exported.directory}: {format_count(exported.episodes, 'throw')} "
        f"of {format_count(exported.trials, 'trial')}, "
        f"{format_count(exported.samples, 'sample')} at {exported.rate_hz} Hz, {exported.size_bytes / 1e6:.1f} MB"
    )
