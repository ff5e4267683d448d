"""`throwcollect dataset rebuild` and `repair`: what is missing is made again, what is damaged is mended."""

from __future__ import annotations

import json as jsonlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import typer

from throwcollect.coordinator.prepare import checked_plan
from throwcollect.dataset.directory import THROWS
from throwcollect.dataset.rebuild import rebuild
from throwcollect.dataset.repair import repair
from throwcollect.errors import LossError
from throwcollect.wording import command, counted

_MOST_NAMED = 10


def show_rebuilt(directory: Path, *, json: bool) -> None:
    """Write the derived files of a dataset anew and print which they are.

    Raises:
        DatasetError: If the plan or a recording is missing or damaged, or a file cannot be written.
        ConfigError: If the configuration of the dataset is wrong.
    """
    rebuilt = rebuild(directory)
    if json:
        typer.echo(jsonlib.dumps(asdict(rebuilt), indent=2))
        return
    found = f"{counted(rebuilt.trials, 'trial')}, {counted(rebuilt.episodes, 'episode')}"
    typer.echo(f"{directory}: {found}; wrote {', '.join(rebuilt.written)}")
    if rejudged := rebuilt.rejudged:
        changes = [f"trial {each.trial}: {each.before} -> {each.after}" for each in rejudged]
        verb = "is" if len(rejudged) == 1 else "are"
        typer.echo(f"{counted(len(rejudged), 'throw')} {verb} judged otherwise: {_named(changes)}")
    if rebuilt.lost:
        typer.echo(f"lost: {_named([str(trial) for trial in rebuilt.lost])}")


def _named(things: Sequence[str]) -> str:
    return ", ".join(things[:_MOST_NAMED]) + (" and more" if len(things) > _MOST_NAMED else "")


def show_repaired(directory: Path, output: Path, *, json: bool) -> None:
    """Mend a dataset into a new directory and print what was wrong and what is lost.

    Raises:
        LossError: If trials are lost, or have other episodes than the table of throws had.
        DatasetError: If configuration and plan cannot be had, or files cannot be read or written.
        ConfigError: If the new directory holds something already.
    """
    repaired = repair(directory, output, remake=lambda config: checked_plan(config, directory=directory))
    if json:
        typer.echo(jsonlib.dumps(repaired.as_dict(), indent=2))
    else:
        for remark in repaired.remarks:
            typer.echo(remark)
        for lost in repaired.lost:
            typer.echo(f"trial {lost.trial}: lost: {lost.reason}")
        typer.echo(f"{output}: {counted(repaired.episodes, 'episode')} of {counted(repaired.trials, 'trial')}")
    if repaired.lost:
        count = len(repaired.lost)
        raise LossError(
            f"{output}: {count} trial{'s are' if count > 1 else ' is'} lost", hint=command("resume", output)
        )
    if repaired.differing:
        first = repaired.differing[0].trial
        raise LossError(
            f"{output}: {counted(len(repaired.differing), 'episode')} kept, such as that of trial {first}, "
            f"which {THROWS} had otherwise",
            hint=f"{command('dataset', 'replay', output, '--trial', first)} simulates it again and compares",
        )
