"""How commands print: results to standard output, as text or as JSON, and remarks to standard error."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Callable
from functools import partial
from typing import Any

import typer

tell = partial(typer.echo, err=True)
"""Print a remark to standard error, where it does not mix with the result."""


def print_json(document: object, *, default: Callable[[Any], object] | None = None) -> None:
    """Print a JSON document; `default` is as for `json.dumps`."""
    typer.echo(jsonlib.dumps(document, indent=2, default=default))


def format_number(number: float | None) -> str:
    """Write a number with six digits, and ``-`` where there is none."""
    return "-" if number is None else f"{number:.6g}"


def print_result(document: object, text: str, *, json: bool) -> None:
    """Print a result: as a JSON document for programs, or as text for people."""
    if json:
        print_json(document)
    else:
        typer.echo(text)
