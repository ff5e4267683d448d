"""Arguments and options: those that several commands share, and how docstrings describe all others."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from throwcollect.cli.printing import print_progress

_LINE = re.compile(r"^ {4}(\w+)(?: \((.*?)\))?: (.*(?:\n {8}.*)*)", re.MULTILINE)
_RANGE = re.compile(r"([\d.]*?)\.\.([\d.]*)")


def describe(function: Callable[..., Any]) -> str:
    """Describe the parameters of a command to typer as its docstring does, and return the help of the command.

    A line of the section ``Options`` has the form ``name (--flag -f METAVAR 1..9): help``, where the least and the
    greatest number belong to numbers. Without a flag, it is the name; parameters before the star are arguments.
    Parameters that are not listed have an annotation that several commands share.
    """
    text, _, lines = (inspect.getdoc(function) or "").partition("\nOptions:\n")
    hints, parameters = get_type_hints(function), inspect.signature(function).parameters
    for name, words, sentence in _LINE.findall(lines):
        flags = [word for word in words.split() if word.startswith("-")]
        others = [word for word in words.split() if not word.startswith("-")]
        bounds = next(filter(None, map(_RANGE.fullmatch, others)), None)
        metavar = next((word for word in others if not _RANGE.fullmatch(word)), None)
        # The commands themselves check that files can be read, and have better messages than typer.
        facts: dict[str, Any] = {"metavar": metavar, "help": " ".join(sentence.split()), "readable": False}
        if bounds is not None:
            facts |= {key: _read_number(number) for key, number in zip(("min", "max"), bounds.groups(), strict=True)}
        if parameters[name].kind is inspect.Parameter.KEYWORD_ONLY:
            flags = flags or ["--" + name.strip("_").replace("_", "-")]
            function.__annotations__[name] = Annotated[hints[name], typer.Option(*flags, **facts)]
        else:
            function.__annotations__[name] = Annotated[hints[name], typer.Argument(**facts)]
    return text.strip()


def _read_number(text: str) -> float | None:
    return int(text) if text.isdigit() else float(text) if text else None


ConfigArgument = Annotated[
    Path, typer.Argument(metavar="CONFIG", help="YAML file of the collection.", show_default=True, readable=False)
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
SimulationsOption = Annotated[
    str | None, typer.Option("-n", metavar="N", help="Number of simulations: run.simulations.")
]
RuntimeOption = Annotated[
    str | None,
    typer.Option("--runtime", metavar="auto|local|docker|inprocess", help="Where the nodes run: run.runtime."),
]
DetachOption = Annotated[
    bool, typer.Option("-d", "--detach", help="Print the id of the run as soon as its nodes are started.")
]
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
