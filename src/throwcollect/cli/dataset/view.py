"""`throwcollect dataset view`: throws for Foxglove, Rerun and RViz."""

from __future__ import annotations

import json as jsonlib
import re
import shlex
from typing import Annotated

import typer

from throwcollect.cli.options import DatasetArgument, JsonOption, OutputArgument
from throwcollect.errors import ConfigError


def view_dataset(
    directory: DatasetArgument,
    output: OutputArgument,
    trials: Annotated[
        str | None, typer.Option("--trials", metavar="3,5,7-9", help="Trials to show; all if not given.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Write throws with frames, meshes, markers and a layout, for Foxglove, Rerun and RViz."""
    from throwcollect.view.viewer_directory import view

    written = view(directory, output, None if trials is None else numbers(trials))
    if json:
        typer.echo(jsonlib.dumps(written.as_dict(), indent=2))
        return
    typer.echo(
        f"{written.recording}: {written.throws} throw{'s' * (written.throws != 1)}, {written.duration_s:.0f} s, "
        f"{written.recording_bytes / 1e6:.1f} MB; meshes beside it: {written.mesh_bytes / 1e6:.1f} MB\n"
        f"Foxglove  open {written.recording.name}, then import the layout {written.layout}\n"
        f"Rerun     ROS_PACKAGE_PATH={shlex.quote(str(output.absolute()))} "
        f"rerun {shlex.quote(str(written.recording))}"
    )


def numbers(text: str) -> list[int]:
    """Numbers of trials such as ``3,5,7-9``, in the order in which they are given.

    Raises:
        ConfigError: If the text is something else, or names a trial twice.
    """
    chosen: list[int] = []
    for part in text.split(","):
        found = re.fullmatch(r"\s*([0-9]{1,7})\s*(?:-\s*([0-9]{1,7})\s*)?", part)
        if found is None:
            raise ConfigError(f"--trials: {part!r} is no trial", expected="numbers and ranges such as 3,5,7-9")
        first, last = int(found[1]), int(found[2] or found[1])
        if last < first:
            raise ConfigError(f"--trials: {part!r} runs backwards", expected=f"{last}-{first}")
        chosen += range(first, last + 1)
    if len(set(chosen)) < len(chosen):
        raise ConfigError(f"--trials: {text!r} names a trial twice", expected="each trial once")
    return chosen
