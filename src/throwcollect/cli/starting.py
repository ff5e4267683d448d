"""`throwcollect init`: a configuration to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from throwcollect.errors import ConfigError
from throwcollect.wording import command


def init(
    robot: Annotated[str, typer.Option("--robot", metavar="NAME", help="The robot: robot.name.")] = "talos",
    task: Annotated[str, typer.Option("--task", metavar="NAME", help="What it does: task.name.")] = "throw",
    sampler: Annotated[
        str, typer.Option("--sampler", metavar="NAME", help="How trials are drawn: sweep.sampler.")
    ] = "sobol",
) -> None:
    """Write a commented throwcollect.yaml, for `throwcollect up`."""
    from throwcollect.config.starter import make_starter
    from throwcollect.files import write_file

    texts = make_starter(robot, task, sampler)
    if there := [name for name in texts if Path(name).exists()]:
        raise ConfigError(f"{there[0]}: is there already", hint="move it away, or go to another directory")
    for name, text in texts.items():
        write_file(Path(name), text.encode())
    typer.echo(f"{' and '.join(texts)}: written. Look at the trials with {command('plan')}, and collect them with:")
    typer.echo(f"  {command('up')}")
