"""`throwcollect dataset verify`: checks that a dataset is whole, and that its throws come out again."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption
from throwcollect.cli.printing import print_result
from throwcollect.errors import DatasetError
from throwcollect.extras import MissingExtraError, install_command
from throwcollect.side_by_side import count_cores
from throwcollect.wording import command, format_count

_SAMPLE = 10
"""Number of throws that are simulated again without `--replay`: they take about two seconds, most of them the start."""


def verify_dataset(
    directory: DatasetArgument,
    replay: Annotated[
        bool, typer.Option("--replay", help=f"Simulate all throws again, and not a sample of {_SAMPLE}.")
    ] = False,
    json: JsonOption = False,
) -> None:
    """Check a dataset against its manifest, itself and a replay; exit code 4 if anything is wrong."""
    from throwcollect.dataset.reader import Dataset
    from throwcollect.dataset.verify import find_unchecked
    from throwcollect.replay.verification import verify_dataset as verify

    count, missing = _count_replayed(directory, replay=replay)
    findings = verify(directory, replay=count or None, processes=count_cores())
    if findings:
        print_result([asdict(finding) for finding in findings], "\n".join(map(str, findings)), json=json)
        raise DatasetError(f"{directory}: {format_count(len(findings), 'finding')}")
    dataset = Dataset.open(directory)
    text = f"replayed: {count} of {format_count(len(dataset.recorded), 'throw')}, the same bit for bit"
    if missing is not None:
        text = f"replayed: 0 of {format_count(len(dataset.recorded), 'throw')} ({missing.message})"
    elif count < len(dataset.recorded):
        text += f" (all: {command('dataset', 'verify', directory, '--replay')})"
    print_result([], f"{directory}: nothing wrong\n{text}", json=json)
    if left_out := find_unchecked(dataset.config):
        typer.echo(f"not checked without the extra collect: {', '.join(left_out)}", err=json)
        typer.echo(f"  try: {install_command('collect')}", err=json)


def _count_replayed(directory: Path, *, replay: bool) -> tuple[int, MissingExtraError | None]:
    """Find how many throws to simulate again: all or a sample, and none where an extra is missing for that."""
    from throwcollect.dataset.reader import Dataset
    from throwcollect.replay.audit import require_simulating

    # If the dataset cannot be opened, the check reports why.
    with suppress(DatasetError):
        dataset = Dataset.open(directory)
        try:
            require_simulating(dataset.config.sim.engine)
        except MissingExtraError as error:
            if replay:
                raise
            return 0, error
        return len(dataset.recorded) if replay else min(_SAMPLE, len(dataset.recorded)), None
    return 0, None
