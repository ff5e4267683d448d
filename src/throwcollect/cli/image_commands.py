"""`throwcollect image`: makes the image of the nodes, for Docker and for Apptainer."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from throwcollect.cli.printing import tell
from throwcollect.errors import ConfigError

BaseOption = Annotated[
    str | None,
    typer.Option("--base", metavar="IMAGE", help="Base image; an official one of Python 3.11 by default."),
]
WheelhouseOption = Annotated[
    Path | None,
    typer.Option(
        "--wheelhouse",
        metavar="DIR",
        help="Take the wheels from here, not from the package index; docker/wheelhouse.py fills it.",
        readable=False,
    ),
]


def build(
    base: BaseOption = None,
    wheelhouse: WheelhouseOption = None,
    tag: Annotated[
        str | None, typer.Option("--tag", metavar="TAG", help="Name of the image; throwcollect:VERSION by default.")
    ] = None,
) -> None:
    """Build the image from a clone of the project."""
    from throwcollect.runtimes.docker.docker_engine import connect
    from throwcollect.runtimes.docker.image import build as build_image
    from throwcollect.runtimes.docker.image import default_tag
    from throwcollect.runtimes.image_sources import DEFAULT_BASE

    tag = tag or default_tag()
    with closing(connect()) as client:
        size = build_image(client, tag, base=base or DEFAULT_BASE, wheelhouse=wheelhouse, say=tell)
    typer.echo(f"{tag}  {size / 1e6:.0f} MB")


def sif(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="File to write; an older one is replaced at the end.")
    ] = Path("throwcollect.sif"),
    image: Annotated[
        str | None, typer.Option("--image", metavar="NAME", help="Convert this image of the Docker engine.")
    ] = None,
    archive: Annotated[
        Path | None,
        typer.Option("--archive", metavar="FILE", help="Convert an archive of `docker save`.", readable=False),
    ] = None,
    base: BaseOption = None,
    wheelhouse: WheelhouseOption = None,
) -> None:
    """Make the image that Apptainer and Singularity run: one file, from the Docker image, or without any engine."""
    from throwcollect.runtimes.apptainer.sif import make_sif

    if image is not None and archive is not None:
        raise ConfigError("--image and --archive: should not be given together")
    if image is not None or archive is not None:
        source = "--archive" if image is None else "--image"
        for name, value in {"--base": base, "--wheelhouse": wheelhouse}.items():
            if value is not None:
                raise ConfigError(f"{name}: should be left out with {source}, as nothing is built")
    size = make_sif(output, image=image, archive=archive, base=base, wheelhouse=wheelhouse, say=tell)
    typer.echo(f"{output}  {size / 1e6:.0f} MB")
