"""The image of containers: built from a clone of the project, pulled, or saved as a file."""

from __future__ import annotations

import re
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import IO

from docker.client import DockerClient
from docker.errors import ImageNotFound

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.files import unwritable, write_all
from throwcollect.runtimes.docker.docker_engine import connect, engine_errors
from throwcollect.runtimes.image_sources import (
    DEFAULT_BASE,
    DOCKERFILE,
    SOURCES_LABEL,
    UNKNOWN,
    are_others,
    check_wheelhouse,
    digest_sources,
    find_address,
    find_revision,
    source_root,
    write_context,
)
from throwcollect.version import __version__

_TARGET = "throwcollect"
SOURCE_LABEL = "org.opencontainers.image.source"
"""Label with the address of the sources; missing if the clone has no address that others can reach."""
RMW_LABEL = "throwcollect.rmw"
"""Label with the middleware of the genuine rclpy in an image; missing if the image has no rclpy."""
_EVIDENCE_LINES = 15
_STEP = re.compile(r"Step (\d+/\d+) : (.*)")
_STEP_COLUMNS = 100
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_BOOKKEEPING = re.compile(r" ---> |Removing intermediate container ")


def default_tag() -> str:
    """Tag of the image of this version."""
    return f"throwcollect:{__version__}"


def build(
    client: DockerClient,
    tag: str,
    *,
    base: str = DEFAULT_BASE,
    wheelhouse: Path | None = None,
    say: Callable[[str], None],
) -> int:
    """Build the image from the clone that this package runs from, and `say` each step in one line.

    The base image is pulled if the engine does not have it. The wheelhouse is a directory of wheels, as
    `docker/wheelhouse.py --ros` fills it; None takes them from the package index.

    Returns:
        Size of the image [B].
    """
    root = source_root()
    check_wheelhouse(wheelhouse)
    if not is_there(client, base):
        hint = "throwcollect image build --base IMAGE takes another one; docker/base.sh makes one from Debian packages"
        say(f"pulling {base}")
        with engine_errors(f"the base image {base} is not here and cannot be pulled", hint=hint):
            client.images.pull(base)
    revision, address = find_revision(root), find_address(root)
    arguments = {
        "BASE_IMAGE": base,
        "VERSION": __version__,
        "REVISION": revision or UNKNOWN,
        "SOURCES": digest_sources(root),
    }
    labels = {SOURCE_LABEL: address} if address else {}
    with engine_errors(f"{tag}: cannot be built"), tempfile.TemporaryFile() as context:
        write_context(context, root, wheelhouse)
        context.seek(0)
        _run_steps(client, context, tag, arguments, labels, say)
        return int(client.images.get(tag).attrs["Size"])


def ensure(client: DockerClient, tag: str, *, say: Callable[[str], None]) -> None:
    """Make sure that the engine has an image: the default one is built from a clone, any other is pulled."""
    if is_there(client, tag):
        return
    if tag != default_tag():
        say(f"image {tag} is not here; pulling it")
        with engine_errors(
            f"the image {tag} is not here and cannot be pulled", hint="docker load brings one from a file"
        ):
            client.images.pull(tag)
        return
    try:
        root = source_root()
        say(f"image {tag} is not here; building it from {root}, once, which takes minutes")
        build(client, tag, say=lambda _line: None)
    except ConfigError as error:
        raise WorkerError(
            f"the image {tag} is not here and cannot be built: {error.message}", hint=error.hint
        ) from error


def is_outdated(client: DockerClient, tag: str) -> bool:
    """Whether an image of the engine was made from other sources than those of this package's clone."""
    return are_others(_read_label(client, tag, SOURCES_LABEL))


def rmw_of(client: DockerClient, tag: str) -> str | None:
    """Middleware of the genuine rclpy in an image of the engine; None if the image has no rclpy."""
    return _read_label(client, tag, RMW_LABEL)


def _read_label(client: DockerClient, tag: str, name: str) -> str | None:
    with engine_errors(f"the engine does not say what the image {tag} holds"):
        label = client.images.get(tag).labels.get(name)
    return label if isinstance(label, str) else None


def is_there(client: DockerClient, image: str) -> bool:
    """Whether the engine has an image."""
    with engine_errors(f"the engine does not say whether it has the image {image}"):
        try:
            client.images.get(image)
        except ImageNotFound:
            return False
        return True


def save_image(
    archive: Path, image: str | None, *, base: str, wheelhouse: Path | None, say: Callable[[str], None]
) -> None:
    """Write an image into an archive, as `docker save` does.

    The image is pulled if the engine does not have it. None takes the image of these sources, which is built, with
    arguments as for `build`, if the engine has none, or one of other sources.
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
    """Receive chunks from the engine, so that its errors are not mistaken for errors of writing the chunks."""
    while True:
        with engine_errors(words):
            chunk = next(chunks, None)
        if chunk is None:
            return
        yield chunk


def _run_steps(
    client: DockerClient,
    context: IO[bytes],
    tag: str,
    arguments: Mapping[str, str],
    labels: Mapping[str, str],
    say: Callable[[str], None],
) -> None:
    printed: deque[str] = deque(maxlen=_EVIDENCE_LINES)
    answers = client.api.build(
        fileobj=context,
        custom_context=True,
        dockerfile=DOCKERFILE,
        target=_TARGET,
        tag=tag,
        buildargs=arguments,
        labels=labels,
        rm=True,
        forcerm=True,
        decode=True,
    )
    for answer in answers:
        for line in _COLOURS.sub("", answer.get("stream", "")).splitlines():
            if step := _STEP.fullmatch(line.strip()):
                say(f"step {step[1]}: {' '.join(step[2].split()):.{_STEP_COLUMNS}}")
            elif line.strip() and not _BOOKKEEPING.match(line):
                printed.append(line.rstrip())
        # The engine sends status 200 before the first step, so it reports a failed step in the stream of output.
        if "error" in answer:
            hint = "a wheel that is missing may come by --wheelhouse DIR, which docker/wheelhouse.py --ros fills"
            raise WorkerError(
                f"{tag}: cannot be built: {answer['error'].strip()}", evidence="\n".join(printed), hint=hint
            )
