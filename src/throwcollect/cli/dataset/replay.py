"""`throwcollect dataset replay`: whether stored throws come out of the simulation again."""

from __future__ import annotations

import json as jsonlib
from dataclasses import asdict
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.wording import format_count


def replay_dataset(
    directory: DatasetArgument,
    trials: Annotated[
        list[int] | None, typer.Option("--trial", metavar="K", help="Number of a trial; may be repeated.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="All trials.")] = False,
    sample: Annotated[
        int | None, typer.Option("--sample", metavar="N", min=1, help="With --all: so many of them, chosen at random.")
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
    for trial in trials or ():
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials or ())) or select_trials(dataset, sample=sample)
    found = []
    for comparison in replay_throws(directory, chosen):
        found.append(comparison)
        if comparison.differences and not json:
            typer.echo(f"trial {comparison.trial}: {'; '.join(comparison.differences)}")
    if json:
        typer.echo(jsonlib.dumps([asdict(comparison) for comparison in found], indent=2))
    differ = sum(bool(comparison.differences) for comparison in found)
    if differ:
        raise DatasetError(
            f"{directory}: {differ} of {format_count(len(found), 'throw')} came out otherwise",
            hint="README.md in it says with which processor and versions it was made",
        )
    if not json:
        typer.echo(f"{directory}: {format_count(len(found), 'throw')} replayed, the same bit for bit")
