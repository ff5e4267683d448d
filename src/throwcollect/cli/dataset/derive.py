"""`throwcollect dataset merge`, `filter`, `sample`, `split` and `stats`: datasets made of others, and statistics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.cli.printing import align, format_number, show
from throwcollect.wording import format_count

if TYPE_CHECKING:
    from throwcollect.dataset.derive.derivation import Derived
    from throwcollect.dataset.derive.statistics import Statistics

_COLUMNS = ("count", "nulls", "min", "q05", "q50", "q95", "max", "mean", "std")
_MOMENTS = ("min", "max", "mean", "std")


def merge(directories: list[Path], output: OutputArgument, *, json: JsonOption = False) -> None:
    """Put the trials of several datasets into one.

    Options:
        directories (DIR): Directories of the datasets.
    """
    from throwcollect.dataset.derive.derivation import merge as merge_datasets

    _show(output, merge_datasets(directories, output), json=json)


def filter_(directory: DatasetArgument, output: OutputArgument, *, where: str, json: JsonOption = False) -> None:
    """Take the trials that fulfil a condition on columns of throws.parquet.

    Options:
        where (CONDITION): Such as: landing_x_m > 1.5
    """
    from throwcollect.dataset.derive.derivation import filter_trials

    _show(output, filter_trials(directory, output, where=where), json=json)


def sample(
    directory: DatasetArgument, output: OutputArgument, *, count: int, seed: int = 0, json: JsonOption = False
) -> None:
    """Take trials at random; they stay in their order.

    Options:
        count (K): Number of trials.
        seed (S 0..): Seed of the choice.
    """
    from throwcollect.dataset.derive.derivation import sample as sample_trials

    _show(output, sample_trials(directory, output, count=count, seed=seed), json=json)


def split(
    directory: DatasetArgument, output: OutputArgument, *, fractions: str, seed: int = 0, json: JsonOption = False
) -> None:
    """Split a dataset so that throws to the same square of 5 cm go to the same part.

    Options:
        fractions (NAME=SHARE,...): Such as: train=0.8,test=0.2
        seed (S 0..): Seed of the choice.
    """
    from throwcollect.dataset.derive.split import split as split_dataset

    parts = split_dataset(directory, output, fractions=fractions, seed=seed)
    lines = (line for name, part in parts.items() for line in _describe(output / name, part))
    show({name: {"directory": output / name, **vars(part)} for name, part in parts.items()}, *lines, json=json)


def render_sensors(
    directory: DatasetArgument, output: OutputArgument, *, sensors: Path, json: JsonOption = False
) -> None:
    """Copy a dataset, and let other cameras and lidars see its throws.

    Options:
        sensors (FILE): YAML file with the section sensors of a configuration.
    """
    from throwcollect.config.loader import load_sensors
    from throwcollect.dataset.derive.derivation import render_sensors as render

    with load_sensors(sensors) as sections:
        derived = render(directory, output, sections)
    _show(output, derived, json=json)


def stats(directory: DatasetArgument, *, json: JsonOption = False) -> None:
    """Print statistics of the table of throws and of all trajectories."""
    from throwcollect.dataset.derive.statistics import statistics

    found = statistics(directory)
    show(found, *_make_tables(found), json=json)


def _show(output: Path, derived: Derived, *, json: bool) -> None:
    counts = ", ".join(f"{count} {outcome}" for outcome, count in derived.without_episode.items())
    left_out = [f"left out, as they have no episode: {counts}"] if counts else []
    show({"directory": output, **vars(derived)}, *_describe(output, derived), *left_out, json=json)


def _describe(output: Path, derived: Derived) -> list[str]:
    return [f"{output}: {format_count(derived.trials, 'trial')}", f"  digest  {derived.digest}"]


def _make_tables(found: Statistics) -> Iterator[str]:
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in found.outcomes.items())
    omitted = f", {found.samples_not_finite} more are not finite" if found.samples_not_finite else ""
    columns = {name: {**vars(column), **column.quantiles} for name, column in found.columns.items()}
    yield f"{format_count(found.trials, 'trial')}: {outcomes}\n"
    yield from _make_table("throws", columns, _COLUMNS)
    for group, signals in found.signals.items():
        yield from ("", *_make_table(group, {name: vars(signal) for name, signal in signals.items()}, _MOMENTS))
    of_all = f"{format_count(found.samples, 'sample')} of {format_count(found.episodes, 'episode')}"
    yield f"\nsignals over {of_all}{omitted}"


def _make_table(title: str, rows: Mapping[str, Mapping[str, Any]], columns: Sequence[str]) -> list[str]:
    cells = [(name, *(format_number(row.get(column)) for column in columns)) for name, row in rows.items()]
    return align([(title, *columns), *cells], numbers=True)
