"""Commands that look into datasets and make others of them; the work is done elsewhere, and imported when called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

dataset_app = typer.Typer(help="Look into datasets, and make others of them.", no_args_is_help=True)

DatasetArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the dataset.", readable=False)]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@dataset_app.command("info")
def dataset_info(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Say what a dataset holds."""
    from throwcollect.cli.dataset import show_info

    show_info(directory, json=json)


@dataset_app.command("verify")
def dataset_verify(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Check a dataset against itself and against physics."""
    from throwcollect.cli.dataset import show_verification

    show_verification(directory, json=json)


@dataset_app.command("digest")
def dataset_digest(directory: DatasetArgument) -> None:
    """Print one hash over all episodes in trial order."""
    from throwcollect.cli.dataset import show_digest

    show_digest(directory)
