"""Arguments and options that several commands have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.printing import print_progress

ConfigArgument = Annotated[
    # The loader checks that the file can be read, and its message is better than that of typer.
    Path,
    typer.Argument(metavar="CONFIG", help="YAML file of the collection.", show_default=True, readable=False),
]
DatasetArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Directory of the dataset.", readable=False)]
OutputArgument = Annotated[Path, typer.Argument(metavar="OUTPUT", help="Directory to write; must be new or empty.")]


def _choose_output(json: bool) -> bool:
    print_progress(not json)
    return json


JsonOption = Annotated[bool, typer.Option("--json", callback=_choose_output, help="Print JSON.")]
"""With it, a command prints one document, and only warnings and errors to standard error."""
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Replace a key of the file; may be repeated.")
]
TrialsOption = Annotated[str | None, typer.Option("--trials", metavar="K", help="Number of trials.")]
RunOption = Annotated[
    str | None,
    typer.Option(
        "--run", metavar="RUN", help="Id of a run, its beginning, or the dataset's directory; by default, the only one."
    ),
]


def overrides(settings: list[str] | None, **options: str | None) -> list[str]:
    """Turn options into overrides of configuration keys, ``key=value``, as ``--set`` takes them.

    Keys of options have ``__`` for a dot, and None if they were not given.
    """
    named = (f"{key.replace('__', '.')}={value}" for key, value in options.items() if value is not None)
    return [*(settings or []), *named]
