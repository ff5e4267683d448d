"""An image in a file, for programs that know nothing of the engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

from docker.client import DockerClient

from throwcollect.files import unwritable, write_all
from throwcollect.runtimes.docker.engine import connect, engine_errors
from throwcollect.runtimes.docker.image import build, default_tag, ensure, is_outdated, is_there


def save_image(
    archive: Path, image: str | None, *, base: str, wheelhouse: Path | None, say: Callable[[str], None]
) -> None:
    """Write an image into an archive, as `docker save` does.

    Args:
        archive: The archive, which is made.
        image: Name of the image, which is pulled if the engine does not have it. None for the one that belongs to these
            sources, which is built if the engine has none, or one of other sources.
        base: Base image, if it is built.
        wheelhouse: Directory of wheels, if it is built; None takes them from the package index.
        say: Called with one line for each step.

    Raises:
        ConfigError: If it has to be built and cannot be, as the package does not run from a clone.
        WorkerError: If no engine answers, or the image cannot be had.
        DatasetError: If the archive cannot be written.
    """
    name = image or default_tag()
    with closing(connect()) as client:
        if image is not None:
            ensure(client, image, say=say)
            if is_outdated(client, image):
                say(f"the image {image} was made from other sources than these; it is used, as it is named")
        elif not is_there(client, name) or is_outdated(client, name):
            say(f"the engine has no image {name} of these sources; building it, which takes minutes")
            build(client, name, base=base, wheelhouse=wheelhouse, say=say)
        say(f"saving {name}")
        _save(client, name, archive)


def _save(client: DockerClient, tag: str, archive: Path) -> None:
    words = f"the engine does not hand out the image {tag}"
    try:
        with archive.open("wb", buffering=0) as file:
            with engine_errors(words):
                chunks = client.images.get(tag).save(named=True)
            for chunk in _receive(chunks, words):
                write_all(file.fileno(), chunk)
    except OSError as error:
        raise unwritable(archive, error) from error


def _receive(chunks: Iterator[bytes], words: str) -> Iterator[bytes]:
    """What the engine sends; its errors are kept apart from those of whoever writes it down."""
    while True:
        with engine_errors(words):
            chunk = next(chunks, None)
        if chunk is None:
            return
        yield chunk
