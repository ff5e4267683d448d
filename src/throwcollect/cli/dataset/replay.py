"""`throwcollect dataset replay`: simulates stored throws again, and compares the results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import print_json
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.wording import format_count


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
    json: JsonOption = False,
) -> None:
    """Simulate stored throws again and compare them bit for bit; exit code 4 if any differs."""
    from throwcollect.dataset.reader import Dataset
    from throwcollect.replay.audit import replay_throws, select_trials

    if bool(trials) == everything:
        raise ConfigError("which throws?", expected="either --trial K, which may be repeated, or --all")
    if sample is not None and not everything:
        raise ConfigError("--sample: should be given with --all")
    dataset = Dataset.open(directory)
    known = dataset.throws["trial"].to_pylist()
    for trial in trials or ():
        if trial not in known:
            raise ConfigError(f"{directory}: no trial {trial}", expected=f"trials from {known[0]} to {known[-1]}")
        # A trial without an episode is refused here, before any throw is simulated.
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials or ())) or select_trials(dataset, sample=sample)
    if engine is not None:
        _compare_engines(directory, engine, chosen, json=json)
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


def _compare_engines(directory: Path, engine: str, trials: Sequence[int], *, json: bool) -> None:
    """Simulate throws with another engine, and print by how much the results differ."""
    from throwcollect.replay.audit import distributions, simulate_with

    deviations = list(simulate_with(directory, engine, trials))
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
