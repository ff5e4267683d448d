"""A chunk of an episode with the hash of its records: the unit in which recordings are hashed, checked and kept."""

from __future__ import annotations

import hashlib
from functools import cached_property

from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_table import MessageList
from throwcollect.errors import DatasetError


class RecordedChunk:
    """A chunk that is decompressed and hashed once, when that is needed.

    Attributes:
        chunk: The recorded messages, compressed.
        stated_sha256: SHA-256 of the uncompressed message records in hexadecimal, as it was written beside them; None
            if it is not known yet.
    """

    def __init__(self, chunk: Chunk, stated_sha256: str | None = None) -> None:
        self.chunk = chunk
        self.stated_sha256 = stated_sha256

    @cached_property
    def contents(self) -> bytes:
        """The uncompressed message records.

        Raises:
            DatasetError: If the chunk is damaged.
        """
        return self.chunk.decompress()

    @cached_property
    def records_sha256(self) -> str:
        """SHA-256 of the uncompressed message records in hexadecimal: `stated_sha256`, or else computed.

        Raises:
            DatasetError: If it has to be computed and the chunk is damaged.
        """
        return self.stated_sha256 or self._contents_sha256

    @cached_property
    def messages(self) -> MessageList:
        """The message records of a sensor.

        Raises:
            DatasetError: If the chunk is damaged, or is no chunk of a sensor.
        """
        return MessageList(self.contents)

    @cached_property
    def _contents_sha256(self) -> str:
        return hashlib.sha256(self.contents).hexdigest()

    def check_records(self) -> None:
        """Hash the message records once and compare the hash with the one that was written beside them.

        Raises:
            DatasetError: If the chunk is damaged, or the hashes differ.
        """
        actual = self._contents_sha256
        if actual != self.records_sha256:
            raise DatasetError(f"chunk: SHA-256 of its records is {actual}", expected=self.records_sha256)
