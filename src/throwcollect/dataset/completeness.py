"""Checks whether the files of a finished dataset are still as written: by their sizes, or byte by byte."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from throwcollect.dataset.directory import CONFIG, MANIFEST, METADATA, PLAN, THROWS
from throwcollect.dataset.findings import Finding
from throwcollect.dataset.manifest import entry_of_file, read_manifest
from throwcollect.dataset.mcap_file import MAGIC
from throwcollect.dataset.mcap_reader import open_mcap
from throwcollect.dataset.throws_table import read_throws_table
from throwcollect.dataset.verify import verify
from throwcollect.dataset.verify_manifest import find_changed_files
from throwcollect.errors import DatasetError
from throwcollect.files import is_there
from throwcollect.sweep.plan import Plan


def find_damage(directory: Path, plan: Plan | None, *, in_full: bool) -> list[Finding]:
    """Find the files of a finished dataset that are not as they were written.

    Files are compared with the manifest. Earlier versions wrote none: then the recordings that the table of throws
    names
    have to begin and end as MCAP files do, or, in full, the dataset is verified.

    Args:
        directory: Directory of a dataset that has its ``metadata.yaml``.
        plan: Its trials; None if they cannot be read.
        in_full: Whether all bytes are compared, and not only the sizes.
    """
    if not is_there(directory / MANIFEST):
        if plan is None:
            return [Finding(PLAN, "", "is missing or damaged")]
        return list(_find_damage_without_manifest(directory, plan, in_full=in_full))
    try:
        entries = read_manifest(directory)
    except DatasetError as error:
        return [Finding.of(MANIFEST, error)]
    return list(find_changed_files(directory, entries, in_full=in_full))


def is_as_written(directory: Path, name: str) -> bool:
    """Whether there is a manifest, and it says of a file of a dataset that it is as it was written."""
    try:
        return entry_of_file(directory / name) in read_manifest(directory)
    except DatasetError:
        return False


def _find_damage_without_manifest(directory: Path, plan: Plan, *, in_full: bool) -> Iterator[Finding]:
    try:
        shards = set(read_throws_table(directory / THROWS, plan)["shard"].drop_null().to_pylist())
    except DatasetError as error:
        yield Finding.of(THROWS, error)
        return
    if in_full:
        # The manifest and the data card follow from these, and a dataset without them counts as whole.
        promised = {CONFIG, PLAN, THROWS, METADATA, *shards}
        yield from (finding for finding in verify(directory) if finding.file in promised)
        return
    for name in sorted(shards):
        try:
            with open_mcap(directory / Path(name).name) as contents:
                # An MCAP file begins and ends with the same bytes, and the end is written last.
                if contents.slice(len(contents) - len(MAGIC), len(contents)) != MAGIC:
                    yield Finding(name, "", "is cut off")
        except DatasetError as error:
            yield Finding.of(name, error)
