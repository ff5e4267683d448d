"""`throwcollect dataset rebuild` and `repair`: write missing tables again, and save what is whole in a damaged one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.cli.printing import print_json
from throwcollect.errors import LossError
from throwcollect.wording import command, format_count

_MOST_NAMED = 10


def rebuild_dataset(directory: DatasetArgument, json: JsonOption = False) -> None:
    """Write throws.parquet, datapackage.json and metadata.yaml anew, from the recordings."""
    from throwcollect.dataset.rebuild import rebuild

    rebuilt = rebuild(directory)
    if json:
        print_json(asdict(rebuilt))
        return
    found = f"{format_count(rebuilt.trials, 'trial')}, {format_count(rebuilt.episodes, 'episode')}"
    typer.echo(f"{directory}: {found}; wrote {', '.join(rebuilt.written)}")
    if rejudged := rebuilt.rejudged:
        changes = [f"trial {each.trial}: {each.before} -> {each.after}" for each in rejudged]
        verb = "is" if len(rejudged) == 1 else "are"
        typer.echo(f"{format_count(len(rejudged), 'throw')} {verb} judged differently: {_join(changes)}")
    if rebuilt.lost:
        typer.echo(f"lost: {_join([str(trial) for trial in rebuilt.lost])}")


def _join(things: Sequence[str]) -> str:
    return ", ".join(things[:_MOST_NAMED]) + (" and more" if len(things) > _MOST_NAMED else "")


def repair_dataset(directory: DatasetArgument, output: OutputArgument, json: JsonOption = False) -> None:
    """Write a sound dataset with all that is whole in a damaged one; exit code 5 if trials are lost."""
    from throwcollect.coordinator.prepare import draw_plan
    from throwcollect.dataset.directory import THROWS
    from throwcollect.dataset.repair import repair

    repaired = repair(directory, output, remake=lambda config: draw_plan(config, directory=directory))
    if json:
        print_json(asdict(repaired))
    else:
        for remark in repaired.remarks:
            typer.echo(remark)
        for lost in repaired.lost[:_MOST_NAMED]:
            typer.echo(f"trial {lost.trial}: lost: {lost.reason}")
        if more := len(repaired.lost[_MOST_NAMED:]):
            typer.echo(f"{format_count(more, 'more trial')} lost, which --json lists")
        typer.echo(
            f"{output}: {format_count(repaired.episodes, 'episode')} of {format_count(repaired.trials, 'trial')}"
        )
    if repaired.lost:
        count = len(repaired.lost)
        raise LossError(
            f"{output}: {count} trial{'s are' if count > 1 else ' is'} lost", hint=command("resume", output)
        )
    if repaired.differing:
        first = repaired.differing[0].trial
        raise LossError(
            f"{output}: {format_count(len(repaired.differing), 'episode')} kept that differ from {THROWS}, "
            f"such as that of trial {first}",
            hint=f"{command('dataset', 'replay', output, '--trial', first)} simulates it again and compares",
        )
