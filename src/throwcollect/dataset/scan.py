"""Finds the episodes of an MCAP file, however damaged the rest of it is.

It relies neither on the order of records nor on their lengths: it finds chunks by the bytes that every header of theirs
holds, wherever they lie. So damage costs the damaged episodes, and never those behind them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from throwcollect.dataset.mcap_file import EPISODE
from throwcollect.dataset.mcap_reader import McapContents, McapRecord, StoredEpisode, map_file
from throwcollect.episode.chunk import MOST_RATIO, RECORD_PREFIX_BYTES, Chunk
from throwcollect.errors import DatasetError

_FACTS_MARK = len(EPISODE).to_bytes(4, "little") + EPISODE.encode()
"""How the contents of the Metadata record of an episode begin."""
_EFFORT = 64
"""Most bytes that are read in vain for each byte of the file; only a file that was made to be slow needs more."""


def scan(contents: McapContents) -> Iterator[StoredEpisode]:
    """Find all whole episodes of a file, in the order in which they lie there; one episode at a time is in memory.

    An episode is whole if its chunk has its CRC and the hash that is written beside it, and header and hash have the
    digest. The search for the next one goes on behind it, and otherwise within its records, as their lengths may be
    what is wrong. The episodes may be of another dataset.

    Args:
        contents: The contents of an MCAP file or of its beginning, finished or not.
    """
    effort = _EFFORT * len(contents)
    # The place of the next metadata of an episode: looked up once for all chunks before it; -1 if there is none.
    facts = 0
    offset = contents.next_chunk(0)
    while offset >= 0 and effort > 0:
        record = contents.record(offset)
        if 0 <= facts < record.end + RECORD_PREFIX_BYTES:
            facts = contents.find(_FACTS_MARK, record.end + RECORD_PREFIX_BYTES)
        found = _find(contents, record, facts - RECORD_PREFIX_BYTES)
        if found is not None:
            yield found
            offset = contents.next_chunk(found.end)
            continue
        # The effort counts the bytes that were read, and those that were decompressed from them at most.
        effort -= len(record.data) + min(Chunk.parse(record.data).uncompressed_size, MOST_RATIO * len(record.data))
        offset = contents.next_chunk(offset + 1)


def scan_file(path: Path) -> Iterator[StoredEpisode]:
    """Find all whole episodes of an MCAP file or of its beginning, in order; a missing file has none."""
    try:
        with map_file(path) as contents:
            yield from scan(contents)
    except DatasetError as error:
        # Only opening tells whether it is there: another process may remove it after a look for it.
        if not isinstance(error.__cause__, FileNotFoundError):
            raise


def _find(contents: McapContents, chunk: McapRecord, facts: int) -> StoredEpisode | None:
    """Read the whole episode whose chunk a record is; None if the record begins no whole episode.

    `facts` is where the next metadata of an episode begin [bytes]; negative if there are none. The message indexes
    between the chunk and these metadata may be damaged.
    """
    try:
        stored = contents.episode_between(chunk, contents.record(facts))
        stored.check_whole()
    except DatasetError:
        return None
    return stored
