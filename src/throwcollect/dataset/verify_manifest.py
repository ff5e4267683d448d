"""Compares the files of a dataset with its manifest, byte by byte."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from throwcollect.dataset.directory import MANIFEST
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import FileEntry, entry_of_file, named_manifest, promised_names
from throwcollect.errors import DatasetError
from throwcollect.wording import command


def manifest_findings(directory: Path, name: str | None) -> Iterator[Finding]:
    """What the manifest of a dataset and its files do not agree in; every byte of the promised files is read.

    Args:
        directory: Directory of the dataset.
        name: Name of the collection; None if it is not known.
    """
    if not (directory / MANIFEST).exists():
        rebuild = command("dataset", "rebuild", directory)
        problem = f"is missing, so changed bytes may go unnoticed; {rebuild} writes it"
        yield Finding(MANIFEST, "", problem)
        return
    try:
        said_name, entries = named_manifest(directory)
    except DatasetError as error:
        yield Finding(MANIFEST, "", error.message.removeprefix(f"{directory / MANIFEST}: "))
        return
    if name is not None and said_name != name:
        yield Finding(MANIFEST, "name", f"is {said_name!r}, in the configuration {name!r}")
    said = {entry.path: entry for entry in entries}
    there = promised_names(directory)
    for path in sorted({*said, *there}):
        if path not in there:
            yield Finding(path, "", f"is missing, {MANIFEST} has it")
        elif path not in said:
            yield Finding(path, "", f"is not in {MANIFEST}")
        elif difference := _difference(directory / path, said[path]):
            yield Finding(path, "", difference)


def _difference(path: Path, said: FileEntry) -> str | None:
    """In what a file differs from its entry in the manifest; None if in nothing."""
    try:
        found = entry_of_file(path)
    except DatasetError as error:
        return error.message.removeprefix(f"{path}: ")
    if found.bytes != said.bytes:
        return f"has {found.bytes} bytes, in {MANIFEST} {said.bytes}"
    if found.sha256 != said.sha256:
        return f"has SHA-256 {found.sha256}, in {MANIFEST} {said.sha256}: its bytes were changed"
    return None
