"""Writes the files that describe a finished dataset as a whole: table of throws, manifest, and the bag's metadata."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.dataset.bag import BAG_SECTION, FileSummary, bag_information, to_yaml
from throwcollect.dataset.carried_robot import list_carried
from throwcollect.dataset.directory import FORMAT, MANIFEST, METADATA, THROWS
from throwcollect.dataset.manifest import DESCRIBING, entry_of, entry_of_file, manifest_text
from throwcollect.dataset.misses import read_targets
from throwcollect.dataset.shard import Recording
from throwcollect.episode.channels import Channels
from throwcollect.files import write_file
from throwcollect.plan.parquet_file import write_table


def write_description(
    directory: Path, name: str, throws: pa.Table, channels: Channels, recordings: Sequence[Recording]
) -> None:
    """Write the files, ``metadata.yaml`` last; they follow from those that are there already.

    Args:
        directory: Directory of the dataset, with its configuration, plan, recordings, data card and provenance.
        name: Name of the collection.
        throws: The table of throws.
        channels: What is recorded.
        recordings: The MCAP files, in their order.
    """
    write_table(directory / THROWS, throws)
    # The manifest covers metadata.yaml, which is written after it, so the entry is made of these bytes.
    metadata = metadata_text([summary for summary, _ in recordings], channels, compute_digest(throws)).encode()
    entries = [
        entry_of(METADATA, metadata),
        *(
            entry_of_file(path, each)
            for each in (*DESCRIBING, *list_carried(directory))
            if (path := directory / each).exists()
        ),
        *(entry for _, entry in recordings),
    ]
    write_file(directory / MANIFEST, manifest_text(name, entries).encode())
    write_file(directory / METADATA, metadata)


def metadata_text(files: Sequence[FileSummary], channels: Channels, digest: str) -> str:
    """Write the text of ``metadata.yaml`` for a dataset of this digest with these MCAP files, in their order."""
    custom = {"throwcollect.format": FORMAT, "throwcollect.digest": digest}
    return to_yaml({BAG_SECTION: bag_information(files, channels.all, custom)})


def compute_digest(throws: pa.Table) -> str:
    """Compute SHA-256 over the digests of all episodes in order of trials, each as 32 bytes.

    The targets of all trials follow, if trials have some, as no episode contains them: of each column its name, a zero
    byte, and the number of each trial as a little-endian double, the NaN 0x7ff8000000000000 where it has none.
    """
    combined = hashlib.sha256()
    # A million digests as strings would take 100 MB.
    for chunk in throws["digest"].chunks:
        combined.update(bytes.fromhex("".join(chunk.drop_null().to_pylist())))
    for name, values in read_targets(throws).items():
        combined.update(name.encode() + b"\0")
        combined.update(np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
    return combined.hexdigest()
