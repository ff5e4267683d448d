"""How commands print: results to standard output, as text or as JSON, and remarks to standard error."""

from __future__ import annotations

import json as jsonlib
from functools import partial

import typer

tell = partial(typer.echo, err=True)
"""Print a remark to standard error, where it does not mix with the result."""


def print_json(document: object) -> None:
    """Print a JSON document."""
    typer.echo(jsonlib.dumps(document, indent=2))


def print_result(document: object, text: str, *, json: bool) -> None:
    """Print a result: as a JSON document for programs, or as text for people."""
    if json:
        print_json(document)
    else:
        typer.echo(text)
