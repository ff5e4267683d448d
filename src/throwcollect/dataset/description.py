"""Writes what describes a finished dataset as a whole: table of throws, manifest, and bag metadata as its mark."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from throwcollect.dataset.bag import FileSummary, dataset_metadata
from throwcollect.dataset.digest import combine_digests
from throwcollect.dataset.directory import CONFIG, MANIFEST, METADATA, PLAN, SOURCES, THROWS, TRIALS
from throwcollect.dataset.manifest import FileEntry, entry_of, entry_of_file, manifest_text
from throwcollect.episode.channels import Channels
from throwcollect.files import write_file
from throwcollect.sweep.parquet_file import encode_table

WRITTEN = (THROWS, MANIFEST, METADATA)
"""Names of the files, in the order in which they are written: ``metadata.yaml`` marks a finished dataset."""


def write_description(
    directory: Path,
    name: str,
    throws: pa.Table,
    channels: Channels,
    recordings: Sequence[tuple[FileSummary, FileEntry]],
) -> None:
    """Write the files; they follow from those that are there already.

    Args:
        directory: Directory of the dataset, with its configuration, plan and recordings.
        name: Name of the collection.
        throws: The table of throws, one row a trial and in order of trials.
        channels: What is recorded.
        recordings: What bag's metadata and manifest say of each MCAP file, in order of files.

    Raises:
        DatasetError: If a file cannot be read or written.
    """
    digest = combine_digests(throws["digest"].drop_null().to_pylist())
    table = encode_table(throws)
    metadata = dataset_metadata([summary for summary, _ in recordings], channels.all, digest).encode()
    others = (directory / each for each in (CONFIG, PLAN, TRIALS, SOURCES))
    entries = [
        entry_of(THROWS, table),
        entry_of(METADATA, metadata),
        *(entry_of_file(path) for path in others if path.exists()),
        *(entry for _, entry in recordings),
    ]
    contents = {THROWS: table, MANIFEST: manifest_text(name, entries).encode(), METADATA: metadata}
    for each in WRITTEN:
        write_file(directory / each, contents[each])
