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

_SUGGESTED = 100
"""Number of throws that the message suggests for a replay."""


def verify_dataset(
    directory: DatasetArgument,
    replay: Annotated[
        int | None,
        typer.Option("--replay", metavar="N", min=1, help="Also simulate N throws again, chosen by the seed."),
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
    print_result([], f"{directory}: nothing wrong\n{_describe_unchecked(dataset, replay)}", json=json)
    if left_out := find_unchecked(dataset.config):
        typer.echo(f"not checked without the extra collect: {', '.join(left_out)}", err=json)
        typer.echo(f"  try: {install_command('collect')}", err=json)


def _describe_unchecked(dataset: Dataset, replay: int | None) -> str:
    """Say what was not checked in a dataset in which nothing is wrong, and which command checks it or what it needs."""
    from throwcollect.dataset.verify_plan import CHECKED_AGAIN
    from throwcollect.robots.description import is_available

    if replay is not None:
        text = f"replayed: {format_count(min(replay, len(dataset.recorded)), 'throw')}, the same bit for bit"
    else:
        text = "not checked: whether the simulation gives the same throws again"
        try:
            require("pinocchio")
            require_engine(dataset.config.sim.engine)
            text += f" ({command('dataset', 'verify', dataset.directory, '--replay', _SUGGESTED)})"
        except MissingExtraError as error:
            text += f" ({error.message})"
    run = len(dataset.plan.trials) - len(dataset.plan.trials.refused)
    if run > CHECKED_AGAIN and is_available(dataset.config):
        text += f"; whether the robot can do them was checked for {CHECKED_AGAIN} of {run} trials"
    return text
