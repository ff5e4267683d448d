"""Makes a SIF, the file that Apptainer runs: of an image that a Docker engine has, of an archive, or from a clone."""

from __future__ import annotations

import os
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from throwcollect.errors import ConfigError, WorkerError
from throwcollect.extras import MissingExtraError, explain_missing
from throwcollect.files import sync_directory, unwritable
from throwcollect.runtimes.apptainer.contents import check_archive, is_sif
from throwcollect.runtimes.apptainer.program import call, find_program
from throwcollect.runtimes.image_sources import (
    DEFAULT_BASE,
    check_wheelhouse,
    digest_sources,
    source_root,
    write_context,
)
from throwcollect.version import __version__

_DEFINITION = "docker/throwcollect.def"
_FAST_COMPRESSION = "-comp zstd -Xcompression-level 3"
"""A quarter of the time that gzip takes, for the same size."""
_NO_SPACE = "no space left on device"
_HINTS = {
    _NO_SPACE: "free 1.5 GB for temporary files, or let TMPDIR name another directory, and 200 MB for the file itself",
    "conveyor failed to get": "--base takes another base image: one of a registry, a SIF, a directory, or an archive",
}
"""What helps, by what Apptainer says in small letters."""


def make_sif(
    output: Path,
    *,
    image: str | None = None,
    archive: Path | None = None,
    base: str | None = None,
    wheelhouse: Path | None = None,
    say: Callable[[str], None],
) -> int:
    """Make a SIF: by default of the image that belongs to these sources, and without an engine from the clone itself.

    Args:
        output: The file. One that is there is replaced when the new one is whole.
        image: Name of another image of the engine, which is pulled if the engine does not have it.
        archive: An archive of an image, as `docker save` writes it, to be taken instead.
        base: Base image, where one is built.
        wheelhouse: Directory of wheels, where an image is built; None takes them from the package index.
        say: Called with one line for each step.

    Returns:
        Its size [B].

    Raises:
        ConfigError: If something is named that does not fit, or there is nothing to make it of.
        WorkerError: If neither Apptainer nor Singularity is installed, or a step fails.
        DatasetError: If it cannot be written, or something cannot be read.
        MissingExtraError: If an image of an engine is named, and the client of engines is not installed.
    """
    find_program()
    with _replacing(output) as new, _working() as work:
        if archive is not None:
            check_archive(archive)
            _convert(archive, new, work, say)
        elif _is_engine_there(image, say):
            from throwcollect.runtimes.docker.saved_image import save_image

            saved = work / "image.tar"
            save_image(saved, image, base=base or DEFAULT_BASE, wheelhouse=wheelhouse, say=say)
            _convert(saved, new, work, say)
        else:
            _build(new, work, base or DEFAULT_BASE, wheelhouse, say)
    return output.stat().st_size


def _is_engine_there(image: str | None, say: Callable[[str], None]) -> bool:
    """Whether an engine answers; where an image of one is named, there has to be one."""
    try:
        with explain_missing():
            from throwcollect.runtimes.docker.engine import connect

            connect().close()
    except MissingExtraError as error:
        if image is not None:
            raise
        reason = f"the package {error.package} is not installed"
    except WorkerError as error:
        if image is not None:
            raise
        reason = error.message
    else:
        return True
    say(f"built from {_DEFINITION}, as {reason}")
    return False


def _convert(archive: Path, new: Path, work: Path, say: Callable[[str], None]) -> None:
    say("converting it, which takes half a minute")
    _run(new, work, f"docker-archive:{archive.resolve()}")


def _build(new: Path, work: Path, base: str, wheelhouse: Path | None, say: Callable[[str], None]) -> None:
    root = source_root()
    check_wheelhouse(root, wheelhouse)
    context = work / "context"
    try:
        with tempfile.TemporaryFile() as packed:
            write_context(packed, root, wheelhouse)
            packed.seek(0)
            with tarfile.open(fileobj=packed) as files:
                files.extractall(context)  # noqa: S202 - written just now
    except OSError as error:
        raise unwritable(context, error) from error
    bootstrap, place = _locate(base)
    values = {"bootstrap": bootstrap, "base": place, "version": __version__, "sources": digest_sources(root)}
    say(f"building it on {base}, which takes minutes")
    arguments = [argument for name, value in values.items() for argument in ("--build-arg", f"{name}={value}")]
    _run(new, work, *arguments, _DEFINITION, cwd=context)


def _locate(base: str) -> tuple[str, str]:
    """How Apptainer gets at a base image, and where it is: a SIF, a directory, an archive, or one of a registry."""
    path = Path(base).absolute()
    if path.is_dir():
        return "localimage", str(path)
    if path.is_file():
        return ("localimage" if is_sif(path) else "docker-archive"), str(path)
    return "docker", base


def _run(new: Path, work: Path, *arguments: str, cwd: Path | None = None) -> None:
    # All that is kept meanwhile goes with this directory.
    places = {"TMPDIR": work, "CACHEDIR": work / "cache", "CONFIGDIR": work / "config"}
    # The output is named before what it is made of.
    *options, source = arguments
    options += ["--force", "--mksquashfs-args", _FAST_COMPRESSION]
    what = f"{new.with_suffix('')}: cannot be made"
    try:
        call(what, "build", *options, str(new), source, cwd=cwd, places=places)
    except WorkerError as error:
        found = next((reason for reason in _HINTS if reason in str(error).lower()), None)
        if found is None:
            raise
        message = f"{what}: {found}" if found == _NO_SPACE else error.message
        raise WorkerError(message, evidence=error.evidence, hint=_HINTS[found]) from error


@contextmanager
def _working() -> Iterator[Path]:
    """A directory for what is needed meanwhile.

    Raises:
        ConfigError: If there is no place for it.
    """
    try:
        directory = tempfile.TemporaryDirectory(prefix="throwcollect-sif-", ignore_cleanup_errors=True)
    except OSError as error:
        problem = f"no directory for temporary files can be written: {error.strerror}"
        raise ConfigError(problem, hint="name one in TMPDIR") from error
    with directory as path:
        yield Path(path)


@contextmanager
def _replacing(output: Path) -> Iterator[Path]:
    """Where to write a SIF that takes the place of another one, or of none, when the block ends well.

    Raises:
        ConfigError: If something else is there.
        DatasetError: If it cannot be written there.
    """
    try:
        if output.is_dir() or (output.exists() and not is_sif(output)):
            raise ConfigError(f"{output}: is there and no SIF, so it is not replaced", hint="choose another name")
        # A link stays, and what it leads to is replaced.
        place = Path(os.path.realpath(output))
        new = place.with_name(f"{place.name}.new")
        new.unlink(missing_ok=True)
        new.touch()
    except OSError as error:
        raise unwritable(output, error) from error
    try:
        yield new
        try:
            os.replace(new, place)
            sync_directory(place.parent)
        except OSError as error:
            raise unwritable(output, error) from error
    finally:
        with suppress(OSError):
            new.unlink(missing_ok=True)
