"""The manifest ``datapackage.json``: size and hash of every file that a dataset promises.

It is a Frictionless Data Package (https://specs.frictionlessdata.io/data-package/), so other tools can check it, too.
It follows from the files alone and its text is canonical: equal files give equal bytes. Data card and provenance, in
which two collections of one dataset differ, are not in it; the provenance has hashes of both.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from throwcollect.config.schema import BODIES, MOTIONS
from throwcollect.dataset.carried_robot import list_carried
from throwcollect.dataset.directory import (
    CONFIG,
    MANIFEST,
    METADATA,
    PLAN,
    ROBOT,
    SHARD_SUFFIX,
    SOURCES,
    THROWS,
    TRIALS,
)
from throwcollect.errors import DatasetError
from throwcollect.files import open_regular, read_text, unreadable
from throwcollect.plan.digest import is_digest
from throwcollect.wording import command

_PROFILE = "data-package"
_HASH = "sha256:"
DESCRIBING = (CONFIG, PLAN, TRIALS, MOTIONS, SOURCES, THROWS)
"""Files next to the recordings and ``metadata.yaml`` that the manifest has, as far as a dataset has them."""
_NAME = re.compile(rf"(?:(?:{ROBOT}|{BODIES})/)?[A-Za-z0-9][A-Za-z0-9_.-]*")
"""A file name without directories but those two, so that no manifest can name a file outside of the dataset."""
_MOST_BYTES = 100_000_000
_BLOCK = 1 << 20


@dataclass(frozen=True)
class FileEntry:
    """One file of a dataset: its name there, its size [bytes], and its SHA-256 in hexadecimal."""

    path: str
    bytes: int
    sha256: str


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a file in the dataset's directory.

    Its place there is a trial, a byte or a field; it is empty if the problem is with the file as a whole.
    """

    file: str
    place: str
    problem: str

    @classmethod
    def of(cls, file: str, error: DatasetError) -> Finding:
        """Make a finding of an error in the file of this name in the dataset's directory."""
        return cls(file, error.place, error.details)

    def __str__(self) -> str:
        return ": ".join(part for part in (self.file, self.place, self.problem) if part)


def entry_of(path: str, data: bytes) -> FileEntry:
    """Make the entry of a file with these contents."""
    return FileEntry(path, len(data), hashlib.sha256(data).hexdigest())


def entry_of_file(path: Path, name: str | None = None) -> FileEntry:
    """Make the entry of a file on disk, which has this name in the dataset."""
    digest, size = hashlib.sha256(), 0
    try:
        with open(open_regular(path), "rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
                size += len(block)
    except OSError as error:
        raise unreadable(path, error) from error
    return FileEntry(name or path.name, size, digest.hexdigest())


def list_promised_names(directory: Path) -> list[str]:
    """List the names of the files in a directory that a manifest has to cover, in order.

    Data card, provenance and logs are not among them, as they differ between equal collections.
    """
    known = {METADATA, *DESCRIBING}
    names = os.listdir(directory)
    promised = [name for name in names if name in known or SHARD_SUFFIX in name or name.endswith(".new")]
    return sorted([*promised, *list_carried(directory)])


def manifest_text(name: str, entries: Iterable[FileEntry]) -> str:
    """Write the text of the manifest of a collection of this name; the entries may come in any order."""
    resources = [
        {"name": entry.path, "path": entry.path, "bytes": entry.bytes, "hash": _HASH + entry.sha256}
        for entry in sorted(entries, key=lambda entry: entry.path)
    ]
    return json.dumps({"profile": _PROFILE, "name": name, "resources": resources}, indent=2) + "\n"


def read_manifest(directory: Path) -> tuple[FileEntry, ...]:
    """Read the entries of the manifest of a dataset, in order of their paths."""
    path = directory / MANIFEST
    if not path.exists():
        raise DatasetError("is missing", path=path, hint=command("resume", directory, "--no-simulate"))
    text = read_text(path, most_bytes=_MOST_BYTES)
    try:
        document = json.loads(text)
        name, entries = str(document["name"]), tuple(map(_read_entry, document["resources"]))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DatasetError("is not the manifest of a dataset", path=path) from error
    # No digest covers the manifest itself, so a changed byte of it shows only by this comparison.
    if text != manifest_text(name, entries) or len({entry.path for entry in entries}) < len(entries):
        raise DatasetError("is not written as the manifest of a dataset is", path=path)
    return entries


def find_changed_files(
    directory: Path, entries: Iterable[FileEntry], *, in_full: bool, hashed: Collection[FileEntry] = ()
) -> Iterator[Finding]:
    """Find the files of a dataset that are not as entries of a manifest say.

    They are compared byte by byte in full, except for those that were `hashed` before, or else only by their sizes.
    """
    for entry in entries:
        path = directory / entry.path
        if not path.exists():
            yield Finding(entry.path, "", f"is missing, {MANIFEST} has it")
            continue
        try:
            # A link has another size than the file that it leads to.
            actual = replace(entry, bytes=path.lstat().st_size)
            if in_full and actual == entry and entry not in hashed:
                actual = entry_of_file(path, entry.path)
        except DatasetError as error:
            yield Finding(entry.path, "", error.problem)
            continue
        if actual.bytes != entry.bytes:
            yield Finding(entry.path, "", f"has {actual.bytes} bytes, in {MANIFEST} {entry.bytes}")
        elif actual != entry:
            yield Finding(
                entry.path, "", f"has SHA-256 {actual.sha256}, in {MANIFEST} {entry.sha256}: its bytes were changed"
            )


def _read_entry(resource: Any) -> FileEntry:
    path, size, digest = resource["path"], resource["bytes"], str(resource["hash"]).removeprefix(_HASH)
    if not isinstance(path, str) or not _NAME.fullmatch(path):
        raise ValueError(path)
    # `isinstance` would also take `true`, which is an `int` in Python.
    if type(size) is not int or not is_digest(digest):
        raise ValueError(size, digest)
    return FileEntry(path, size, digest)
