"""`throwcollect dataset verify`: whether a dataset is whole, and can have been recorded."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Iterator
from pathlib import Path

import typer

from throwcollect.coordinator.prepare import feasibility_check
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.reader import Dataset
from throwcollect.dataset.verify import verify
from throwcollect.dataset.verify_plan import CHECKED_AGAIN
from throwcollect.errors import DatasetError
from throwcollect.replay.audit import chosen_trials, replayed
from throwcollect.wording import command, counted

_SUGGESTED = 100
"""Throws that are suggested for a replay."""


def show_verification(directory: Path, *, replay: int | None, json: bool) -> None:
    """Print what is wrong with a dataset.

    Args:
        directory: Directory of the dataset.
        replay: How many throws to simulate again, too; None for none.
        json: Whether to print one JSON document.

    Raises:
        DatasetError: If anything is wrong, or the directory holds no finished dataset.
        WorkerError: If the physics engine does not start.
    """
    findings = verify(directory, check_of=feasibility_check)
    if replay is not None:
        findings += _replay_findings(directory, replay)
    if json:
        typer.echo(jsonlib.dumps([finding.as_dict() for finding in findings], indent=2))
    else:
        for finding in findings:
            typer.echo(str(finding))
    if findings:
        raise DatasetError(f"{directory}: {counted(len(findings), 'finding')}")
    if not json:
        typer.echo(f"{directory}: nothing wrong\n{_not_checked(directory, replay)}")


def _replay_findings(directory: Path, count: int) -> Iterator[Finding]:
    """Throws that do not come out of the simulation as they are stored."""
    try:
        dataset = Dataset.open(directory)
        shards = dataset.throws["shard"].to_pylist()
        for comparison in replayed(directory, chosen_trials(dataset, sample=count)):
            if comparison.differences:
                told = "; ".join(comparison.differences)
                yield Finding(shards[comparison.trial], f"trial {comparison.trial}", f"comes out otherwise: {told}")
    except DatasetError as error:
        yield Finding("", "", f"cannot be replayed: {error}")


def _not_checked(directory: Path, replay: int | None) -> str:
    """What was not looked at in a dataset in which nothing is wrong, and the command that does."""
    dataset = Dataset.open(directory)
    if replay is not None:
        told = f"replayed: {counted(min(replay, len(dataset)), 'throw')}, the same bit for bit"
    else:
        more = command("dataset", "verify", directory, "--replay", _SUGGESTED)
        told = f"not checked: whether the simulation gives the same throws again ({more})"
    run = sum(trial.refused is None for trial in dataset.plan.trials)
    if run > CHECKED_AGAIN:
        told += f"; whether the robot can do them was checked of {CHECKED_AGAIN} of {run} trials"
    return told
