"""`throwcollect dataset replay`: whether stored throws come out of the simulation again."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import typer

from throwcollect.dataset.reader import Dataset
from throwcollect.errors import ConfigError, DatasetError
from throwcollect.replay.audit import chosen_trials, replayed
from throwcollect.wording import counted


def show_replay(directory: Path, trials: Sequence[int], *, everything: bool, sample: int | None, json: bool) -> None:
    """Simulate stored throws again and print in what they differ.

    Args:
        directory: Directory of the dataset.
        trials: Numbers of trials.
        everything: Whether all trials are meant instead.
        sample: How many of all; None for all of them.
        json: Whether to print one JSON document.

    Raises:
        ConfigError: If it is not clear which trials are meant.
        DatasetError: If a throw differs, has no episode or is damaged.
        WorkerError: If the physics engine does not start.
    """
    if bool(trials) == everything:
        raise ConfigError("which throws?", expected="either --trial K, which may be repeated, or --all")
    if sample is not None and not everything:
        raise ConfigError("--sample: should be given with --all")
    dataset = Dataset.open(directory)
    for trial in trials:
        dataset.episode(trial)
    chosen = list(dict.fromkeys(trials)) or chosen_trials(dataset, sample=sample)
    found = []
    for comparison in replayed(directory, chosen):
        found.append(comparison)
        if comparison.differences and not json:
            typer.echo(f"trial {comparison.trial}: {'; '.join(comparison.differences)}")
    if json:
        typer.echo(jsonlib.dumps([asdict(comparison) for comparison in found], indent=2))
    differ = sum(bool(comparison.differences) for comparison in found)
    if differ:
        raise DatasetError(
            f"{directory}: {differ} of {counted(len(found), 'throw')} came out otherwise",
            hint="README.md in it says with which processor and versions it was made",
        )
    if not json:
        typer.echo(f"{directory}: {counted(len(found), 'throw')} replayed, the same bit for bit")
