"""Makes a SIF, the file that Apptainer runs, from an image of a Docker engine, from an archive, or from a clone."""

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
from throwcollect.runtimes.apptainer.archive import check_archive, unpack_archive
from throwcollect.runtimes.apptainer.program import call, find_program
from throwcollect.runtimes.apptainer.sif_contents import is_sif
from throwcollect.runtimes.image_sources import (
    DEFAULT_BASE,
    check_wheelhouse,
    digest_sources,
    source_root,
    write_context,
)
from throwcollect.version import __version__

_DEFINITION = "docker/throwcollect.def"
_UNPACKED = "image"
_FAST_COMPRESSION = "-comp zstd -Xcompression-level 3"
"""Takes a quarter of the time of gzip, for the same size."""


def make_sif(
    output: Path,
    *,
    image: str | None = None,
    archive: Path | None = None,
    base: str | None = None,
    wheelhouse: Path | None = None,
    say: Callable[[str], None],
) -> int:
    """Make a SIF, by default from the image of these sources, or without an engine from the clone itself.

    An existing SIF is replaced when the new one is complete. `image` names another image of the engine, which is pulled
    if the engine does not have it; `archive` is a file with an image, as `docker save` writes it. `base` and
    `wheelhouse` are as for `docker.image.build`.

    Returns:
        Size of the file [B].
    """
    # Saving or building an image takes minutes, so a missing Apptainer is reported before that.
    find_program()
    with _replacing(output) as new, _make_work_directory() as made:
        work = Path(made)
        if archive is not None:
            check_archive(archive)
            _convert(archive, new, work, say)
        elif _is_engine_there(image, say):
            from throwcollect.runtimes.docker.image import save_image

            saved = work / "image.tar"
            save_image(saved, image, base=base or DEFAULT_BASE, wheelhouse=wheelhouse, say=say)
            _convert(saved, new, work, say)
        else:
            _build(new, work, base or DEFAULT_BASE, wheelhouse, say)
    return output.stat().st_size


def _is_engine_there(image: str | None, say: Callable[[str], None]) -> bool:
    """Whether an engine answers; if `image` names an image, a missing engine is an error."""
    try:
        with explain_missing():
            from throwcollect.runtimes.docker.docker_engine import connect

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
    say("converting it, which takes some seconds")
    try:
        unpack_archive(archive, work / _UNPACKED)
        if archive.parent == work:
            # Apptainer writes two more copies of the image, and may need the disk space of this one.
            archive.unlink()
    except OSError as error:
        hint = "TMPDIR names the directory of temporary files, which needs 2 GB"
        raise WorkerError(f"{new.with_suffix('')}: cannot be made: {error.strerror}", hint=hint) from error
    _run(new, work, f"oci:{_UNPACKED}", cwd=work)


def _build(new: Path, work: Path, base: str, wheelhouse: Path | None, say: Callable[[str], None]) -> None:
    root = source_root()
    check_wheelhouse(wheelhouse)
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
    """Apptainer's word for the kind of a base image, and its place: a SIF, a directory, an archive, or a registry."""
    path = Path(base).absolute()
    if path.is_dir():
        return "localimage", str(path)
    if path.is_file():
        return ("localimage" if is_sif(path) else "docker-archive"), str(path)
    return "docker", base


def _run(new: Path, work: Path, *arguments: str, cwd: Path | None = None) -> None:
    # All temporary files of Apptainer are removed together with this directory.
    places = {"TMPDIR": work, "CACHEDIR": work / "cache", "CONFIGDIR": work / "config"}
    # Apptainer wants the output before the source.
    *options, source = arguments
    options += ["--force", "--mksquashfs-args", _FAST_COMPRESSION]
    call(f"{new.with_suffix('')}: cannot be made", "build", *options, str(new), source, cwd=cwd, places=places)


def _make_work_directory() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="throwcollect-sif-", ignore_cleanup_errors=True)


@contextmanager
def _replacing(output: Path) -> Iterator[Path]:
    """Give a path for a new SIF, which takes the place of the output if the block ends without an error."""
    try:
        if output.is_dir() or (output.exists() and not is_sif(output)):
            raise ConfigError(f"{output}: exists and is no SIF, so it is not replaced", hint="choose another name")
        # If the output is a link, the file that the link names is replaced.
        place = Path(os.path.realpath(output))
        new = place.with_name(f"{place.name}.new")
        new.unlink(missing_ok=True)
        # This fails at once if the directory cannot be written, and not after minutes.
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
