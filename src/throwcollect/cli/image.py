"""`throwcollect image ...`: the image that containers are made from."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import typer

from throwcollect.runtime.docker_engine import connect
from throwcollect.runtime.image import DEFAULT_BASE, build, default_tag


def build_image(*, base: str | None, wheelhouse: Path | None, tag: str | None) -> None:
    """Build the image and print its tag and size; the steps go to standard error.

    Args:
        base: Base image; None for the usual one.
        wheelhouse: Directory of wheels; None for the package index.
        tag: Name of the image; None for that of this version.

    Raises:
        ConfigError: If the package does not run from a clone, or the wheelhouse holds no wheels.
        WorkerError: If no engine answers, the base image cannot be had, or a step fails.
    """
    tag = tag or default_tag()
    with closing(connect()) as client:
        size = build(client, tag, base=base or DEFAULT_BASE, wheelhouse=wheelhouse, say=_say)
    typer.echo(f"{tag}  {size / 1e6:.0f} MB")


def _say(line: str) -> None:
    typer.echo(line, err=True)
