"""Compares the files of a dataset with its manifest: by their sizes, or byte by byte."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from throwcollect.dataset.directory import MANIFEST
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import (
    FileEntry,
    entry_of_file,
    list_promised_names,
    read_named_manifest,
    size_of_file,
)
from throwcollect.errors import DatasetError
from throwcollect.files import is_there
from throwcollect.wording import command


def find_manifest_problems(directory: Path, name: str | None) -> Iterator[Finding]:
    """Find where the manifest of a dataset and its files differ; every byte of the promised files is read.

    Args:
        directory: Directory of the dataset.
        name: Name of the collection; None if it is not known.
    """
    if not (directory / MANIFEST).exists():
        rebuild = command("dataset", "rebuild", directory)
        yield Finding(MANIFEST, "", f"is missing, so changed bytes may go unnoticed; {rebuild} writes it")
        return
    try:
        said_name, entries = read_named_manifest(directory)
    except DatasetError as error:
        yield Finding(MANIFEST, "", error.problem)
        return
    if name is not None and said_name != name:
        yield Finding(MANIFEST, "name", f"is {said_name!r}, in the configuration {name!r}")
    said = {entry.path for entry in entries}
    yield from find_changed_files(directory, entries, in_full=True)
    yield from (
        Finding(path, "", f"is not in {MANIFEST}") for path in list_promised_names(directory) if path not in said
    )


def find_changed_files(directory: Path, entries: Iterable[FileEntry], *, in_full: bool) -> Iterator[Finding]:
    """Find the files that are not as a manifest says.

    Args:
        directory: Directory of the dataset.
        entries: Those of the manifest.
        in_full: Whether the bytes of all files are hashed; else only their sizes are compared.
    """
    for said in entries:
        path = directory / said.path
        if not is_there(path):
            yield Finding(said.path, "", f"is missing, {MANIFEST} has it")
            continue
        try:
            found = entry_of_file(path) if in_full else replace(said, bytes=size_of_file(path))
        except DatasetError as error:
            yield Finding(said.path, "", error.problem)
            continue
        if found.bytes != said.bytes:
            yield Finding(said.path, "", f"has {found.bytes} bytes, in {MANIFEST} {said.bytes}")
        elif found != said:
            yield Finding(
                said.path, "", f"has SHA-256 {found.sha256}, in {MANIFEST} {said.sha256}: its bytes were changed"
            )
