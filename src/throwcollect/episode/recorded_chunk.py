"""A chunk of an episode with the hash of its records: the unit in which recordings are hashed, checked and kept."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_table import MessageList
from throwcollect.errors import DatasetError


@dataclass(frozen=True, eq=False)
class RecordedChunk:
    """A chunk that is decompressed and hashed once, when that is needed.

    Attributes:
        chunk: The recorded messages, compressed.
        records_sha256: SHA-256 of the uncompressed message records in hexadecimal, as it was written beside them.
        indexes: MCAP Message Index records of the chunk by channel, as they came with it; empty if they did not.
    """

    chunk: Chunk
    records_sha256: str
    indexes: Mapping[int, bytes] = field(default_factory=dict)

    @classmethod
    def of(cls, contents: bytes | bytearray | memoryview, data: bytes, *, start_ns: int, end_ns: int) -> RecordedChunk:
        """Make the chunk of message records, which are given both uncompressed and compressed."""
        chunk = Chunk.of(contents, data, start_ns=start_ns, end_ns=end_ns)
        return cls(chunk, hashlib.sha256(contents).hexdigest())

    @cached_property
    def contents(self) -> bytes:
        """The uncompressed message records."""
        return self.chunk.decompress()

    @cached_property
    def messages(self) -> MessageList:
        """The message records of a sensor."""
        return MessageList(self.contents)

    @cached_property
    def _contents_sha256(self) -> str:
        return hashlib.sha256(self.contents).hexdigest()

    def check_records(self) -> None:
        """Hash the message records once and compare the hash with the one that was written beside them."""
        actual = self._contents_sha256
        if actual != self.records_sha256:
            raise DatasetError(f"chunk: SHA-256 of its records is {actual}", expected=self.records_sha256)
