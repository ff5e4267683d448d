"""Reads an archive with an image, as `docker save` writes it."""

from __future__ import annotations

import hashlib
import json
import tarfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from lzma import LZMAError
from pathlib import Path
from typing import IO, Any

from throwcollect.errors import ConfigError
from throwcollect.files import unreadable

_ENTRY_POINT = "throwcollect"
_HINT = "docker save throwcollect:TAG -o FILE writes one"
_OCI = "application/vnd.oci.image"
_LAYER = f"{_OCI}.layer.v1.tar"
_COMPRESSIONS = {b"\x1f\x8b": "gzip", b"\x28\xb5": "zstd"}
"""How a layer is compressed, by its first two bytes; most engines save layers as they are."""
_PIECE_BYTES = 1 << 20
_DAMAGED = (tarfile.TarError, zlib.error, LZMAError, EOFError, LookupError, TypeError, AttributeError, ValueError)
"""Errors that reading gets if a file is no archive, is damaged or holds no image."""


def check_archive(archive: Path) -> None:
    """Make sure that a file is an archive, as `docker save` writes it, with one image of throwcollect."""
    try:
        with _refuse_damage(f"{archive}: is no archive of an image"):
            with tarfile.open(archive) as files:
                images = _read_json(files, "manifest.json")
                configs = [_read_json(files, image["Config"]) for image in images]
            # `[None]` stands for an image without an entry point. With ROS 2, a script is started before the command.
            entry_points = [config["config"].get("Entrypoint") or [None] for config in configs]
    except (FileNotFoundError, IsADirectoryError) as error:
        raise ConfigError(f"{archive}: {error.strerror}", hint=_HINT) from error
    except OSError as error:
        raise unreadable(archive, error) from error
    if len(entry_points) != 1:
        raise ConfigError(f"{archive}: holds {len(entry_points)} images", expected="one", hint=_HINT)
    if entry_points[0][-1] != _ENTRY_POINT:
        raise ConfigError(f"{archive}: holds an image that is not of throwcollect", hint=_HINT)


def unpack_archive(archive: Path, directory: Path) -> None:
    """Unpack the image of an archive into a new directory, in the layout of OCI, which Apptainer converts fastest.

    Given an archive, Apptainer would compress its layers, only to unpack them again, which takes four times as long as
    the rest of the conversion. It takes the layers of such a directory as they are.
    """
    blobs = directory / "blobs" / "sha256"
    blobs.mkdir(parents=True)
    with _refuse_damage(f"{archive}: is damaged"), tarfile.open(archive) as files:
        (image,) = _read_json(files, "manifest.json")
        stored = _store(_open(files, image["Config"]), blobs)
        config = {"mediaType": f"{_OCI}.config.v1+json", **stored.reference}
        layers = []
        for name in image["Layers"]:
            compression = _COMPRESSIONS.get(_open(files, name).read(2))
            kind = f"{_LAYER}+{compression}" if compression else _LAYER
            stored = _store(_open(files, name), blobs)
            layers.append({"mediaType": kind, **stored.reference})
    manifest = {"schemaVersion": 2, "mediaType": f"{_OCI}.manifest.v1+json", "config": config, "layers": layers}
    written = directory / "manifest.json"
    written.write_text(json.dumps(manifest), encoding="utf-8")
    with written.open("rb") as file:
        index = [{"mediaType": manifest["mediaType"], **_store(file, blobs).reference}]
    (directory / "index.json").write_text(json.dumps({"schemaVersion": 2, "manifests": index}), encoding="utf-8")
    (directory / "oci-layout").write_text(json.dumps({"imageLayoutVersion": "1.0.0"}), encoding="utf-8")


@contextmanager
def _refuse_damage(message: str) -> Iterator[None]:
    """Turn the errors of reading a damaged archive, or something else than an archive, into one with this message."""
    try:
        yield
    except _DAMAGED as error:
        raise ConfigError(message, hint=_HINT) from error
    except OSError as error:
        # Those of the system have a number; gzip and bzip2 raise this error, without one, for damaged contents.
        if error.errno is not None:
            raise
        raise ConfigError(message, hint=_HINT) from error


@dataclass(frozen=True)
class _StoredFile:
    """A file of a layout of OCI, whose name is its digest in hexadecimal digits."""

    path: Path
    size: int

    @property
    def reference(self) -> dict[str, str | int]:
        """Digest and size, by which a manifest refers to the file."""
        return {"digest": f"sha256:{self.path.name}", "size": self.size}


def _store(file: IO[bytes], blobs: Path) -> _StoredFile:
    """Copy a file to the path that its digest gives."""
    new, digest, size = blobs / "new", hashlib.sha256(), 0
    with new.open("wb") as copy:
        while piece := file.read(_PIECE_BYTES):
            digest.update(piece)
            size += copy.write(piece)
    return _StoredFile(new.replace(blobs / digest.hexdigest()), size)


def _read_json(files: tarfile.TarFile, name: str) -> Any:
    return json.load(_open(files, name))


def _open(files: tarfile.TarFile, name: str) -> IO[bytes]:
    file = files.extractfile(name)
    # `extractfile` returns None for a directory and other members that are no files.
    if file is None:
        raise KeyError(name)
    return file
