"""Whether all that a finished dataset promises is still there: cheaply by names and sizes, or in full by every byte."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from throwcollect.dataset.directory import CONFIG, MANIFEST, METADATA, PLAN, THROWS
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import entry_of_file, read_manifest
from throwcollect.dataset.mcap_file import MAGIC
from throwcollect.dataset.throws_table import read_throws_table
from throwcollect.dataset.verify import verify
from throwcollect.dataset.verify_manifest import find_changed_files
from throwcollect.errors import DatasetError
from throwcollect.files import is_there, open_regular
from throwcollect.sweep.plan import Plan


def find_damage(directory: Path, plan: Plan | None, *, in_full: bool) -> list[Finding]:
    """What of a finished dataset is not as it was written.

    Files are compared with the manifest. A dataset of a version that wrote none has to have the recordings that its
    table of throws names, each with the beginning and the end of an MCAP file; in full, it is verified.

    Args:
        directory: Directory of a dataset that has its ``metadata.yaml``.
        plan: Its trials; None if they cannot be read.
        in_full: Whether the contents of all files are compared, and not only their sizes.
    """
    if plan is None and not is_there(directory / MANIFEST):
        return [Finding(PLAN, "", "is missing or damaged")]
    if plan is not None and not is_there(directory / MANIFEST):
        return list(_without_manifest(directory, plan, in_full=in_full))
    try:
        entries = read_manifest(directory)
    except DatasetError as error:
        return [Finding.of(MANIFEST, error)]
    return list(find_changed_files(directory, entries, in_full=in_full))


def is_as_written(directory: Path, name: str) -> bool:
    """Whether the manifest says of a file that it is as it was written; False if there is no manifest that does.

    Args:
        directory: Directory of a dataset.
        name: Name of the file.
    """
    try:
        return entry_of_file(directory / name) in read_manifest(directory)
    except DatasetError:
        return False


def _without_manifest(directory: Path, plan: Plan, *, in_full: bool) -> Iterator[Finding]:
    try:
        shards = set(read_throws_table(directory / THROWS, plan)["shard"].drop_null().to_pylist())
    except DatasetError as error:
        yield Finding.of(THROWS, error)
        return
    if in_full:
        promised = {CONFIG, PLAN, THROWS, METADATA, *shards}
        yield from (finding for finding in verify(directory) if finding.file in promised)
        return
    for name in sorted(shards):
        try:
            descriptor = open_regular(directory / Path(name).name)
        except OSError as error:
            yield Finding(name, "", "is missing" if isinstance(error, FileNotFoundError) else "is not a file")
            continue
        # An MCAP file begins and ends with the same bytes, and the end is written last.
        with open(descriptor, "rb") as file:
            begins = file.read(len(MAGIC))
            file.seek(-min(len(MAGIC), os.fstat(descriptor).st_size), os.SEEK_END)
            if begins != MAGIC or file.read() != MAGIC:
                yield Finding(name, "", "is cut off, or is no MCAP file")
