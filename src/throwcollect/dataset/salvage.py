"""Finds the whole episodes of an MCAP file, however damaged the rest of it is.

Neither the order of records nor their lengths are relied on: chunks are found by the bytes that every header of theirs
holds, wherever they lie, and a chunk is an episode when its contents have the CRC and the hashes that are written
beside it. So what is lost is what was damaged, and never what follows it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mcap import records

from throwcollect.dataset.mcap_file import EPISODE, episode_run
from throwcollect.dataset.mcap_reader import McapContents, Record, StoredEpisode, mapped
from throwcollect.episode.chunk import MOST_RATIO, Chunk
from throwcollect.episode.message import make_episode
from throwcollect.errors import DatasetError

_FACTS_MARK = len(EPISODE).to_bytes(4, "little") + EPISODE.encode()
"""How the contents of the Metadata record of an episode begin."""
_PREFIX_BYTES = 9
"""Opcode and length of a record."""
_EFFORT = 64
"""Bytes that may be looked at in vain for each byte of the file; only a file made to be slow takes more."""


@dataclass(frozen=True)
class Salvaged:
    """A whole episode.

    Attributes:
        stored: The episode as it lies in the file; without message indexes if those are damaged.
        intact: Whether its run of records is byte for byte what is written for the episode. If not, its message
            indexes or its metadata are damaged, and the episode has to be written anew.
    """

    stored: StoredEpisode
    intact: bool

    @property
    def offset(self) -> int:
        """Where its run of records begins [bytes]."""
        return self.stored.chunk.offset

    @property
    def whole_until(self) -> int:
        """Where its run of records ends [bytes]; a file may be cut there."""
        return self.stored.facts.end


def salvage(path: Path) -> Iterator[Salvaged]:
    """All whole episodes of a file, in the order in which they lie there; one episode at a time is in memory.

    An episode is whole when its chunk has its CRC and holds one message per channel and sample, the message records
    have the SHA-256 that is written beside them, and header and SHA-256 have the digest. Whether it is one of the
    dataset's is not known here. An intact episode that begins where the one before ended lies in an undamaged stretch
    of the file.

    Args:
        path: An MCAP file or the beginning of one, finished or not.

    Raises:
        DatasetError: If the file is missing or cannot be read.
    """
    with mapped(path) as contents:
        effort = _EFFORT * len(contents)
        facts = 0
        offset = contents.next_chunk(0)
        while offset >= 0 and effort > 0:
            record = contents.record(offset)
            if 0 <= facts < record.end + _PREFIX_BYTES:
                facts = contents.find(_FACTS_MARK, record.end + _PREFIX_BYTES)
            chunk = Chunk.parse(record.data)
            found = None
            with suppress(DatasetError):
                found = _episode(contents, record, chunk, contents.record(facts - _PREFIX_BYTES))
            if found is not None:
                yield found
            else:
                effort -= len(record.data) + min(chunk.uncompressed_size, MOST_RATIO * len(record.data))
            offset = contents.next_chunk(found.whole_until if found else offset + 1)


def _episode(contents: McapContents, record: Record, chunk: Chunk, facts: Record) -> Salvaged:
    """The episode of a chunk and of the metadata that follow it.

    Raises:
        DatasetError: If they do not belong together, or one of them is damaged.
    """
    said = facts.parse(records.Metadata).metadata
    episode = make_episode(said.get("header", ""), said.get("records_sha256", "").encode(), chunk)
    if said.get("digest") != episode.digest:
        raise DatasetError(f"byte {facts.offset}: the digest is not that of the header", expected=episode.digest)
    episode.check_records()
    intact = contents.slice(record.offset, facts.end) == episode_run(episode).data
    indexes = contents.message_indexes(record.end)[0] if intact else {}
    return Salvaged(StoredEpisode(episode, record, indexes, facts), intact)
