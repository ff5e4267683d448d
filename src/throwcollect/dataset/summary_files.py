"""Writes the files that describe a finished dataset as a whole: table of throws, manifest, and the bag's metadata."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from throwcollect.dataset.bag import BAG_SECTION, bag_information, to_yaml
from throwcollect.dataset.directory import CONFIG, FORMAT, MANIFEST, METADATA, PLAN, SOURCES, THROWS, TRIALS
from throwcollect.dataset.manifest import entry_of, entry_of_file, manifest_text
from throwcollect.dataset.misses import read_targets
from throwcollect.dataset.shard import Recording
from throwcollect.episode.channels import Channels
from throwcollect.files import replacing, write_all, write_file
from throwcollect.sweep.parquet_file import encode_pieces
from throwcollect.sweep.points import Targets

_ROWS_AT_ONCE = 1 << 16
_BYTES_AT_ONCE = 1 << 20


def write_description(
    directory: Path,
    name: str,
    throws: pa.Table,
    channels: Channels,
    recordings: Sequence[Recording],
    *,
    on_piece: Callable[[], object] = lambda: None,
) -> None:
    """Write the files, ``metadata.yaml`` last; they follow from those that are there already.

    Args:
        directory: Directory of the dataset, with its configuration, plan and recordings.
        name: Name of the collection.
        throws: The table of throws.
        channels: What is recorded.
        recordings: The MCAP files, in their order.
        on_piece: Called after each piece of the table, which is read column by column, so that its memory can be freed.
    """
    digest = combine_digests(_read_digests(throws, on_piece), read_targets(throws))
    custom = {"throwcollect.format": FORMAT, "throwcollect.digest": digest}
    bag = bag_information([summary for summary, _ in recordings], channels.all, custom)
    # The manifest covers metadata.yaml, which is written after it, so the entry is made of these bytes.
    metadata = to_yaml({BAG_SECTION: bag}).encode()
    with replacing(directory / THROWS) as descriptor:
        waiting = bytearray()

        def put(data: bytes) -> None:
            waiting.extend(data)
            if len(waiting) >= _BYTES_AT_ONCE:
                write_all(descriptor, waiting)
                waiting.clear()
            on_piece()

        encode_pieces(throws, put)
        write_all(descriptor, waiting)
    others = (directory / each for each in (THROWS, CONFIG, PLAN, TRIALS, SOURCES))
    entries = [
        entry_of(METADATA, metadata),
        *(entry_of_file(path) for path in others if path.exists()),
        *(entry for _, entry in recordings),
    ]
    write_file(directory / MANIFEST, manifest_text(name, entries).encode())
    write_file(directory / METADATA, metadata)


def combine_digests(digests: Iterable[str], targets: Targets | None) -> str:
    """Compute SHA-256 over the digests of all episodes in order of trials, each as 32 bytes; digests are hexadecimal.

    The targets of all trials follow, if trials have some, as no episode contains them: of each column its name, a zero
    byte, and the number of each trial as a little-endian double, the NaN 0x7ff8000000000000 where it has none.
    """
    combined = hashlib.sha256()
    for digest in digests:
        combined.update(bytes.fromhex(digest))
    for name, values in () if targets is None else zip(targets.names, targets.values.T, strict=True):
        combined.update(name.encode() + b"\0")
        combined.update(np.where(np.isnan(values), np.nan, values).astype("<f8").tobytes())
    return combined.hexdigest()


def _read_digests(throws: pa.Table, on_piece: Callable[[], object]) -> Iterator[str]:
    """Read the digests of the episodes, in order, some at a time: as Python texts, a million would fill 100 MB."""
    for first in range(0, len(throws), _ROWS_AT_ONCE):
        yield from throws["digest"].slice(first, _ROWS_AT_ONCE).drop_null().to_pylist()
        on_piece()
