"""Finds the episodes of an MCAP file, however damaged the rest of it is.

It relies neither on the order of records nor on their lengths: it finds chunks by the bytes that every header of theirs
holds, wherever they lie. So damage costs the damaged episodes, and never those behind them.

All commands find episodes with `scan`: recovery takes the whole ones, and verify reports what lies between the
readable ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap import records

from throwcollect.dataset.mcap_file import EPISODE, SENSORS_SHA256
from throwcollect.dataset.mcap_reader import MOST_CHUNKS, McapContents, McapRecord, StoredChunk, StoredEpisode, map_file
from throwcollect.episode.chunk import MOST_RATIO, RECORD_PREFIX_BYTES, Chunk
from throwcollect.errors import DatasetError

_FACTS_MARK = len(EPISODE).to_bytes(4, "little") + EPISODE.encode()
"""How the contents of the Metadata record of an episode begin."""
_EFFORT = 64
"""Most bytes that are read in vain for each byte of the file; only a file that was made to be slow needs more."""


@dataclass(frozen=True)
class FoundEpisode:
    """An episode that was found.

    Attributes:
        stored: The episode as it lies in the file; without message indexes if it is not readable.
        readable: Whether its records follow each other as they are written. If not, it was put together from its
            chunks and the metadata behind them.
        damage: Why its contents cannot be believed; None if it is whole: each chunk has its CRC and the hash that is
            written beside it, and header and hash have the digest.
        intact: Whether its run of records is byte for byte what is written for the episode. A whole episode that is
            not intact has damaged message indexes or metadata, and has to be written anew.
    """

    stored: StoredEpisode
    readable: bool
    damage: DatasetError | None
    intact: bool


def scan(contents: McapContents, start: int = 0) -> Iterator[FoundEpisode]:
    """Find all episodes of a file, in the order in which they lie there; one episode at a time is in memory.

    They may be of another dataset. Behind an episode that is not whole, the search goes on within its records, as their
    lengths may be what is wrong.

    Args:
        contents: The contents of an MCAP file or of its beginning, finished or not.
        start: Where to begin [bytes].
    """
    effort = _EFFORT * len(contents)
    # The place of the next metadata of an episode: looked up once for all chunks before it; -1 if there is none.
    facts = 0
    offset = contents.next_chunk(start)
    while offset >= 0 and effort > 0:
        record = contents.record(offset)
        if 0 <= facts < record.end + RECORD_PREFIX_BYTES:
            facts = contents.find(_FACTS_MARK, record.end + RECORD_PREFIX_BYTES)
        found = _find(contents, record, facts - RECORD_PREFIX_BYTES)
        if found is not None:
            yield found
        if found is None or found.damage is not None:
            # The effort counts the bytes that were read, and those that were decompressed from them at most.
            size = Chunk.parse(record.data).uncompressed_size
            effort -= len(record.data) + min(size, MOST_RATIO * len(record.data))
        whole = found is not None and found.damage is None
        offset = contents.next_chunk(found.stored.end if found and whole else offset + 1)


def scan_whole(path: Path) -> Iterator[FoundEpisode]:
    """Find all whole episodes of an MCAP file or of its beginning, in order; a missing file has none."""
    try:
        with map_file(path) as contents:
            yield from (found for found in scan(contents) if found.damage is None)
    except DatasetError as error:
        # Only opening tells whether it is there: another process may remove it after a look for it.
        if not isinstance(error.__cause__, FileNotFoundError):
            raise


def _find(contents: McapContents, first: McapRecord, facts: int) -> FoundEpisode | None:
    """Read the episode whose first chunk a record is; None if the record begins no episode.

    `facts` is where the next metadata of an episode begin [bytes]; negative if there are none.
    """
    try:
        stored, readable = contents.episode(first), True
    except DatasetError:
        try:
            # The records around the chunk may be damaged, while the chunk and the metadata behind it are not.
            stored, readable = _gather(contents, first, contents.record(facts)), False
            stored.check_whole()
        except DatasetError:
            return None
        return FoundEpisode(stored, readable, None, intact=False)
    try:
        stored.check_whole()
        intact = contents.slice(stored.offset, stored.end) == stored.intact_run.data
    except DatasetError as error:
        return FoundEpisode(stored, readable, error, intact=False)
    return FoundEpisode(stored, readable, None, intact)


def _gather(contents: McapContents, first: McapRecord, facts: McapRecord) -> StoredEpisode:
    """Make an episode of a chunk and of some metadata, with as many further chunks as the metadata have hashes of."""
    chunks = [StoredChunk(first, {})]
    stated = facts.parse(records.Metadata).metadata
    # A forged file may name any number of hashes.
    for _ in stated.get(SENSORS_SHA256, "").split()[:MOST_CHUNKS]:
        offset = contents.next_chunk(chunks[-1].record.end)
        if not 0 <= offset < facts.offset:
            break
        chunks.append(StoredChunk(contents.record(offset), {}))
    return StoredEpisode.of(chunks, facts, stated)
