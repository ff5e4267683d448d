"""`throwcollect dataset merge|filter|sample|split|stats`: datasets made of others, and statistics."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from throwcollect.derive.derivation import Derived
from throwcollect.derive.selection import filtered, merge, sample
from throwcollect.derive.split import SQUARES, split
from throwcollect.derive.statistics import Statistics, statistics
from throwcollect.wording import counted

_COLUMNS = ("count", "nulls", "min", "q05", "q50", "q95", "max", "mean", "std")
_MOMENTS = ("min", "max", "mean", "std")


def show_merged(directories: Sequence[Path], output: Path, *, json: bool) -> None:
    """Merge datasets and print what came of it.

    Raises:
        ConfigError: If the datasets do not go together, or the output cannot be used.
        DatasetError: If a dataset is damaged or the output cannot be written.
    """
    _show(output, merge(directories, output), json=json)


def show_filtered(directory: Path, output: Path, *, where: str, json: bool) -> None:
    """Filter a dataset and print what came of it.

    Raises:
        ConfigError: If the condition is wrong or fits no trial, or the output cannot be used.
        DatasetError: If the dataset is damaged or the output cannot be written.
    """
    _show(output, filtered(directory, output, where=where), json=json)


def show_sample(directory: Path, output: Path, *, count: int, seed: int, json: bool) -> None:
    """Sample a dataset and print what came of it.

    Raises:
        ConfigError: If there are not so many trials, or the output cannot be used.
        DatasetError: If the dataset is damaged or the output cannot be written.
    """
    _show(output, sample(directory, output, count=count, seed=seed), json=json)


def show_split(
    directory: Path, output: Path, *, fractions: str, cells: Sequence[str] | None, seed: int, json: bool
) -> None:
    """Split a dataset and print what came of it.

    Raises:
        ConfigError: If fractions or cells are wrong, a part is empty, or the output cannot be used.
        DatasetError: If the dataset is damaged or a part cannot be written.
    """
    found = split(directory, output, fractions=fractions, cells=cells or SQUARES, seed=seed)
    if json:
        typer.echo(jsonlib.dumps(found.as_dict(), indent=2))
        return
    for name, part in found.parts.items():
        elsewhere = f", {part.uncelled} in no cell" if part.uncelled else ""
        typer.echo(f"{output / name}: {_trials(part.dataset)} in {counted(part.cells, 'cell')}{elsewhere}")
        typer.echo(f"  digest  {part.dataset.digest}")
    _tell_left_out(found.without_episode)


def show_statistics(directory: Path, *, json: bool) -> None:
    """Print statistics of a dataset.

    Raises:
        DatasetError: If the directory holds no finished dataset, or it is damaged.
    """
    found = statistics(directory)
    typer.echo(jsonlib.dumps(found.as_dict(), indent=2) if json else _tables(found), nl=json)


def _show(output: Path, derived: Derived, *, json: bool) -> None:
    if json:
        typer.echo(jsonlib.dumps({"directory": str(output), **derived.as_dict()}, indent=2))
        return
    typer.echo(f"{output}: {_trials(derived)}")
    typer.echo(f"  digest  {derived.digest}")
    _tell_left_out(derived.without_episode)


def _trials(derived: Derived) -> str:
    return f"{derived.trials} of {counted(derived.offered, 'trial')}"


def _tell_left_out(without_episode: Mapping[str, int]) -> None:
    if without_episode:
        counts = ", ".join(f"{count} {outcome}" for outcome, count in without_episode.items())
        typer.echo(f"left out, as they have no episode: {counts}")


def _tables(found: Statistics) -> str:
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in found.outcomes.items())
    omitted = f", {found.samples_not_finite} more are not finite" if found.samples_not_finite else ""
    columns = {name: {**vars(column), **column.quantiles} for name, column in found.columns.items()}
    text = f"{counted(found.trials, 'trial')}: {outcomes}\n\n" + _table("throws", columns, _COLUMNS)
    for group, signals in found.signals.items():
        text += "\n" + _table(group, {name: vars(signal) for name, signal in signals.items()}, _MOMENTS)
    return f"{text}\nsignals over {counted(found.samples, 'sample')} of {counted(found.episodes, 'episode')}{omitted}\n"


def _table(title: str, rows: Mapping[str, Mapping[str, Any]], columns: Sequence[str]) -> str:
    lines = [(title, *columns)]
    lines += [(name, *(_cell(row.get(column)) for column in columns)) for name, row in rows.items()]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "".join(
        "  ".join([first.ljust(widths[0]), *map(str.rjust, rest, widths[1:])]) + "\n" for first, *rest in lines
    )


def _cell(number: float | None) -> str:
    return "-" if number is None else f"{number:.6g}"
