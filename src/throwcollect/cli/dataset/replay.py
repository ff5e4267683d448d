"""`throwcollect dataset replay`: simulates stored throws again, and compares the results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import print_json
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.extras import require
from throwcollect.wording import format_count

if TYPE_CHECKING:
    from throwcollect.replay.other_engine import Deviation


def replay_dataset(
    directory: DatasetArgument,
    trials: Annotated[
        list[int] | None, typer.Option("--trial", metavar="K", help="Number of a trial; may be repeated.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All trials.")] = False,
    sample: Annotated[
        int | None, typer.Option("--sample", metavar="N", min=1, help="With --all: N of them, chosen at random.")
    ] = None,
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="Simulate them with another engine: how much differs?")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --engine: a picture (PNG) of how far landings are apart.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Simulate stored throws again and compare them bit for bit; exit code 4 if any differs."""
    from throwcollect.dataset.reader import Dataset
    from throwcollect.replay.audit import replay_throws, select_trials

    if bool(trials) == everything:
        raise ConfigError("which throws?", expected="either --trial K, which may be repeated, or --all")
    if sample is not None and not everything:
        raise ConfigError("--sample: should be given with --all")
    if plot is not None and engine is None:
        raise ConfigError("--plot: should be given with --engine")
    dataset = Dataset.open(directory)
    known = dataset.throws["trial"].to_pylist()
    for trial in trials or ():
        if trial not in known:
            raise ConfigError(f"{directory}: no trial {trial}", expected=f"trials from {known[0]} to {known[-1]}")
        # A trial without an episode is refused here, before any throw is simulated.
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials or ())) or select_trials(dataset, sample=sample)
    if engine is not None:
        _compare_engines(directory, engine, chosen, plot, json=json)
        return
    comparisons = []
    for comparison in replay_throws(directory, chosen):
        comparisons.append(comparison)
        if comparison.differences and not json:
            typer.echo(f"trial {comparison.trial}: {'; '.join(comparison.differences)}")
    if json:
        print_json([asdict(comparison) for comparison in comparisons])
    differ = sum(bool(comparison.differences) for comparison in comparisons)
    if differ:
        raise DatasetError(
            f"{directory}: {differ} of {format_count(len(comparisons), 'throw')} came out differently",
            hint="its README.md says with which processor and versions it was made",
        )
    if not json:
        typer.echo(f"{directory}: {format_count(len(comparisons), 'throw')} replayed, the same bit for bit")


def _compare_engines(directory: Path, engine: str, trials: Sequence[int], plot: Path | None, *, json: bool) -> None:
    """Simulate throws with another engine, and print by how much the results differ."""
    from throwcollect.replay.other_engine import LANDING, simulate_with

    if plot is not None:
        require("plotly", "matplotlib")
        from throwcollect.report.throw.deviations import check_picture

        check_picture(plot)
    deviations = list(simulate_with(directory, engine, trials))
    # Print the numbers first, so that they are not lost if the picture cannot be drawn after all.
    _print_deviations(directory, engine, deviations, json=json)
    if plot is not None:
        from throwcollect.report.throw.deviations import write_deviations

        landed = [each.values for each in deviations if all(column in each.values for column in LANDING)]
        if not landed:
            raise ConfigError("--plot: no throw landed with both engines")
        write_deviations([[each[column] for each in landed] for column in LANDING], engine, plot)


def _print_deviations(directory: Path, engine: str, deviations: Sequence[Deviation], *, json: bool) -> None:
    from throwcollect.replay.other_engine import distributions

    found = distributions(deviations)
    differ = sum(each.stored != each.again for each in deviations)
    if json:
        print_json({"throws": [asdict(each) for each in deviations], "columns": [asdict(each) for each in found]})
        return
    width = max(len(each.column) for each in found)
    typer.echo(f"{'by ' + engine + ', above stored':{width}}  throws       mean        rms     median    largest")
    for each in found:
        numbers = "".join(f"{value:11.3g}" for value in (each.mean, each.rms, each.median, each.largest))
        typer.echo(f"{each.column:{width}}  {each.throws:6}{numbers}")
    typer.echo(f"{directory}: {format_count(len(deviations), 'throw')} by {engine}; {differ} with another outcome")
