"""`throwcollect dataset merge`, `filter`, `sample`, `split` and `stats`: datasets made of others, and statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.cli.printing import align, format_number, print_result
from throwcollect.wording import format_count

if TYPE_CHECKING:
    from throwcollect.derive.derivation import Derived
    from throwcollect.derive.statistics import Statistics

SeedOption = Annotated[int, typer.Option("--seed", metavar="S", min=0, help="Seed of the choice.")]

_COLUMNS = ("count", "nulls", "min", "q05", "q50", "q95", "max", "mean", "std")
_MOMENTS = ("min", "max", "mean", "std")


def merge_datasets(
    directories: Annotated[list[Path], typer.Argument(metavar="DIR", help="Directories of the datasets.")],
    output: OutputArgument,
    json: JsonOption = False,
) -> None:
    """Put the trials of several datasets into one."""
    from throwcollect.derive.derivation import merge

    _show(output, merge(directories, output), json=json)


def filter_dataset(
    directory: DatasetArgument,
    output: OutputArgument,
    where: Annotated[str, typer.Option("--where", metavar="CONDITION", help="Such as: landing_x_m > 1.5")],
    json: JsonOption = False,
) -> None:
    """Take the trials that fulfil a condition on columns of throws.parquet."""
    from throwcollect.derive.derivation import filter_trials

    _show(output, filter_trials(directory, output, where=where), json=json)


def sample_dataset(
    directory: DatasetArgument,
    output: OutputArgument,
    count: Annotated[int, typer.Option("--count", metavar="K", help="Number of trials.")],
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> None:
    """Take trials at random; they stay in their order."""
    from throwcollect.derive.derivation import sample

    _show(output, sample(directory, output, count=count, seed=seed), json=json)


def split_dataset(
    directory: DatasetArgument,
    output: OutputArgument,
    fractions: Annotated[
        str, typer.Option("--fractions", metavar="NAME=SHARE,...", help="Such as: train=0.8,test=0.2")
    ],
    cells: Annotated[
        list[str] | None,
        typer.Option("--cells", metavar="EXPRESSION=WIDTH", help="Axis of the cells that stay whole; may be repeated."),
    ] = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> None:
    """Split a dataset so that throws to the same place, by default a square of 5 cm, go to the same part."""
    from throwcollect.derive.split import SQUARES, split

    found = split(directory, output, fractions=fractions, cells=cells or SQUARES, seed=seed)
    # Each trial with an episode is in one part, so shares are shares of these.
    whole = format_count(sum(part.dataset.trials for part in found.parts.values()), "trial")
    if found.without_episode:
        whole += " that have an episode,"
    lines = []
    for name, part in found.parts.items():
        elsewhere = f", {part.uncelled} in no cell" if part.uncelled else ""
        places = format_count(part.cells, "cell") + elsewhere
        lines.append(f"{output / name}: {part.dataset.trials} of {whole} in {places}")
        lines.append(f"  digest  {part.dataset.digest}")
    print_result(found.as_dict(), "\n".join([*lines, *_list_left_out(found.without_episode)]), json=json)


def show_statistics(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Print statistics of the table of throws and of all trajectories."""
    from throwcollect.derive.statistics import statistics

    found = statistics(directory)
    print_result(found.as_dict(), _make_tables(found), json=json)


def _show(output: Path, derived: Derived, *, json: bool) -> None:
    counts = f"{derived.trials} of {format_count(derived.offered, 'trial')}"
    lines = [f"{output}: {counts}", f"  digest  {derived.digest}"]
    text = "\n".join([*lines, *_list_left_out(derived.without_episode)])
    print_result({"directory": str(output), **derived.as_dict()}, text, json=json)


def _list_left_out(without_episode: Mapping[str, int]) -> list[str]:
    counts = ", ".join(f"{count} {outcome}" for outcome, count in without_episode.items())
    return [f"left out, as they have no episode: {counts}"] if counts else []


def _make_tables(found: Statistics) -> str:
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in found.outcomes.items())
    omitted = f", {found.samples_not_finite} more are not finite" if found.samples_not_finite else ""
    columns = {name: {**vars(column), **column.quantiles} for name, column in found.columns.items()}
    text = f"{format_count(found.trials, 'trial')}: {outcomes}\n\n" + _make_table("throws", columns, _COLUMNS)
    for group, signals in found.signals.items():
        text += "\n" + _make_table(group, {name: vars(signal) for name, signal in signals.items()}, _MOMENTS)
    of_all = f"{format_count(found.samples, 'sample')} of {format_count(found.episodes, 'episode')}"
    return f"{text}\nsignals over {of_all}{omitted}"


def _make_table(title: str, rows: Mapping[str, Mapping[str, Any]], columns: Sequence[str]) -> str:
    lines = [(title, *columns)]
    lines += [(name, *(format_number(row.get(column)) for column in columns)) for name, row in rows.items()]
    return "".join(f"{line}\n" for line in align(lines, numbers=True))
