"""What is printed of a finished collection."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from throwcollect.cli.dataset.info import describe
from throwcollect.cli.streams import ensure_written
from throwcollect.wording import command


def print_summary(summary: Mapping[str, Any], directory: Path | None, *, as_json: bool) -> None:
    """Print the summary of a dataset.

    Args:
        summary: What `dataset info` says, and whether the run was ``open``.
        directory: Directory of the dataset; None if it is in a volume.
        as_json: Whether to print one JSON document.

    Raises:
        OutputError: If it cannot be printed.
    """
    if as_json:
        typer.echo(json.dumps(summary, indent=2))
    else:
        sys.stdout.write(describe(summary))
    if directory is not None and not as_json:
        typer.echo(f"look into it: {command('dataset', 'info', directory)}   (or open the .mcap files in Foxglove)")
    ensure_written(hint=f"{command('dataset', 'info', directory)} prints it again" if directory is not None else None)
