"""`throwcollect dataset verify`: checks that a dataset is whole, and that its throws are physically possible."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import print_result
from throwcollect.errors import DatasetError
from throwcollect.extras import MissingExtraError, install_command, require, require_engine
from throwcollect.side_by_side import count_cores
from throwcollect.wording import command, format_count

if TYPE_CHECKING:
    from throwcollect.dataset.reader import Dataset


def verify_dataset(
    directory: DatasetArgument,
    replay: Annotated[
        int | None,
        typer.Option(
            "--replay",
            metavar="N",
            min=0,
            help="Simulate N throws again, chosen by the seed; 10 by default, where engine and libraries are the same.",
        ),
    ] = None,
    json: JsonOption = False,
) -> None:
    """Check a dataset against itself and against physics; exit code 4 if anything is wrong."""
    from throwcollect.dataset.reader import Dataset
    from throwcollect.dataset.verify import find_unchecked
    from throwcollect.replay.verification import verify_dataset as verify

    findings = verify(directory, replay=replay, processes=count_cores())
    if findings:
        print_result([asdict(finding) for finding in findings], "\n".join(map(str, findings)), json=json)
        raise DatasetError(f"{directory}: {format_count(len(findings), 'finding')}")
    dataset = Dataset.open(directory)
    print_result([], f"{directory}: nothing wrong\n{_describe_replay(dataset, replay)}", json=json)
    if left_out := find_unchecked(dataset.config):
        typer.echo(f"not checked without the extra collect: {', '.join(left_out)}", err=json)
        typer.echo(f"  try: {install_command('collect')}", err=json)


def _describe_replay(dataset: Dataset, replay: int | None) -> str:
    """Say how many throws were simulated again in a dataset in which nothing is wrong, and how to simulate more."""
    from throwcollect.replay.verification import count_replayed

    count, recorded = count_replayed(dataset, replay), len(dataset.recorded)
    text = f"replayed: {count} of {format_count(recorded, 'throw')}"
    if count == recorded:
        return f"{text}, the same bit for bit"
    text += ", the same bit for bit" if count else ""
    try:
        require("pinocchio")
        require_engine(dataset.config.sim.engine)
    except MissingExtraError as error:
        return f"{text} ({error.message})"
    return f"{text} (all: {command('dataset', 'verify', dataset.directory, '--replay', recorded)})"
