"""The one message that carries an episode from a simulation to whoever collects: std_msgs/UInt8MultiArray.

Its layout names the parts of its data: ``header``, an `EpisodeHeader` in JSON; ``conditions``, what it was simulated
with, in JSON; ``chunk``, an MCAP Chunk record; and ``signature``, that of everything before it. Whoever takes it in
hashes the records, so no hash is ever believed, and none is computed twice.
"""

from __future__ import annotations

import hashlib
import itertools
import re
import struct
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError

from throwcollect.episode.chunk import Chunk, MessageTable
from throwcollect.episode.layout import MessageLayout
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.interfaces import get_message
from throwcollect.run_key import Signer

_PARTS = ("header", "conditions", "chunk", "signature")
_SHA256 = re.compile(rb"[0-9a-f]{64}")
_HEADER = TypeAdapter(EpisodeHeader)
_LATEST_NS = 2**62
_MOST_SAMPLES = 2**32
"""As many as sequence numbers of message records can count."""
_LONGEST_NAME, _LONGEST_TEXT = 256, 10_000
"""Characters in names and messages; Talos' names and the controllers' messages stay far below."""
_STATUSES = range(7)
"""Of action_msgs/msg/GoalStatus."""
_COUNT = struct.Struct("<I")


class Episode:
    """What one trial yielded, as it travels and rests; decompressed when it is looked at.

    Attributes:
        header: What is known besides the samples.
        chunk: The recorded messages, compressed.
        said_sha256: SHA-256 of the uncompressed message records in hexadecimal, as it was written beside them; None if
            nobody has said it yet.
    """

    def __init__(self, header: EpisodeHeader, chunk: Chunk, said_sha256: str | None = None) -> None:
        self.header = header
        self.chunk = chunk
        self.said_sha256 = said_sha256

    @cached_property
    def records_sha256(self) -> str:
        """SHA-256 of the uncompressed message records in hexadecimal: as it was said, or else worked out.

        Raises:
            DatasetError: If it has to be worked out and the chunk is damaged.
        """
        return self.said_sha256 or hashlib.sha256(self.contents).hexdigest()

    @cached_property
    def header_json(self) -> str:
        """The header as `header_to_json` writes it."""
        return header_to_json(self.header)

    @cached_property
    def contents(self) -> bytes:
        """The uncompressed message records.

        Raises:
            DatasetError: If the chunk is damaged.
        """
        return self.chunk.decompress()

    @cached_property
    def table(self) -> MessageTable:
        """The message records as a table.

        Raises:
            DatasetError: If the chunk is damaged, or does not hold one message per channel and sample.
        """
        return MessageTable(self.contents, self.header.samples)

    def samples(self) -> Samples:
        """The samples, as views of the records where possible.

        Raises:
            DatasetError: If the chunk is damaged, or its messages are laid out otherwise than they are written.
        """
        return self.table.samples

    @cached_property
    def digest(self) -> str:
        """SHA-256 over the header's JSON, one zero byte and `records_sha256` as 32 bytes, in hexadecimal."""
        return hashlib.sha256(self.header_json.encode() + b"\0" + bytes.fromhex(self.records_sha256)).hexdigest()

    def check_records(self) -> None:
        """Hash the message records again.

        Raises:
            DatasetError: If the chunk is damaged, or `records_sha256` is not that of its records.
        """
        actual = hashlib.sha256(self.contents).hexdigest()
        if actual != self.records_sha256:
            raise DatasetError(f"chunk: SHA-256 of its records is {actual}", expected=self.records_sha256)


def header_to_json(header: EpisodeHeader) -> str:
    """The header in JSON: keys in the order of their declaration, no blanks; equal headers give equal text."""
    return _HEADER.dump_json(header).decode()


def header_from_json(text: bytes | str) -> EpisodeHeader:
    """Read what `header_to_json` writes.

    Raises:
        DatasetError: If the text is anything else.
    """
    try:
        header = _HEADER.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise DatasetError(f"episode header: {place}: {first['msg']}; {error.error_count()} problems in all") from error
    if header.trial < 0 or not 1 <= header.samples <= _MOST_SAMPLES:
        raise DatasetError(f"episode header: trial {header.trial} with {header.samples} samples")
    instants = [header.start_ns, *(instant for each in header.contacts for instant in (each.start_ns, each.end_ns))]
    if any(instant is not None and not 0 <= instant <= _LATEST_NS for instant in instants):
        raise DatasetError("episode header: an instant that no clock shows", expected=f"0 to {_LATEST_NS} ns")
    for contact in header.contacts:
        if not 1 <= len(contact.body) <= _LONGEST_NAME:
            raise DatasetError(f"episode header: a contact with a body whose name has {len(contact.body)} characters")
        if contact.end_ns is not None and contact.end_ns < contact.start_ns:
            raise DatasetError(f"episode header: a contact with {contact.body} that ends before it begins")
    for goal in header.goals:
        if (
            len(goal.controller) > _LONGEST_NAME
            or len(goal.error_string) > _LONGEST_TEXT
            or goal.status not in _STATUSES
        ):
            raise DatasetError(f"episode header: goal of {goal.controller[:_LONGEST_NAME]!r}: cannot be")
    return header


@cache
def _layout() -> MessageLayout:
    dimension = get_message("std_msgs/msg/MultiArrayDimension")
    layout = get_message("std_msgs/msg/MultiArrayLayout")(dim=[dimension(label=part) for part in _PARTS])
    message = get_message("std_msgs/msg/UInt8MultiArray")(layout=layout)
    return MessageLayout(message, [f"layout.dim.{n}.{key}" for n in range(len(_PARTS)) for key in ("size", "stride")])


class Delivery(NamedTuple):
    """What a simulation hands over.

    Attributes:
        episode: The episode.
        conditions: What it was simulated with, in JSON.
    """

    episode: Episode
    conditions: str


def pack(episode: Episode, conditions: str, signer: Signer) -> bytes:
    """The CDR bytes of the message that carries an episode."""
    parts = [episode.header_json.encode(), conditions.encode(), episode.chunk.record()]
    signature = signer.sign(*parts).encode()
    return b"".join((_prefix([*map(len, parts), len(signature)]), *parts, signature))


def _prefix(sizes: list[int]) -> bytes:
    """What comes before the data: the layout, and at the end the data's size."""
    prefix = bytearray(_layout().template)
    np.frombuffer(prefix, _layout().dtype)[0] = tuple(size for size in sizes for _ in ("size", "stride"))
    _COUNT.pack_into(prefix, len(prefix) - _COUNT.size, sum(sizes) % 2**32)
    return bytes(prefix)


def unpack(message: bytes, signer: Signer) -> Delivery:
    """Read the message that carries an episode.

    Args:
        message: CDR bytes of a std_msgs/UInt8MultiArray.
        signer: That of the run.

    Raises:
        DatasetError: If it is not what `pack` writes, or is signed with another key; the contents of the chunk are not
            looked at yet.
    """
    layout = _layout()
    length = len(layout.template)
    if len(message) < length:
        raise DatasetError(f"episode: a message of {len(message)} bytes", expected=f"at least {length}")
    sizes = list(np.frombuffer(message, layout.dtype, count=1)[0].item()[::2])
    if message[:length] != _prefix(sizes):
        raise DatasetError(f"episode: not a UInt8MultiArray of the parts {', '.join(_PARTS)}")
    # Some RMWs hand over what they have padded.
    if len(message) < length + sum(sizes):
        raise DatasetError(f"episode: {len(message) - length} bytes of data", expected=f"{sum(sizes)} as announced")
    whole = memoryview(message)
    ends = list(itertools.accumulate(sizes, initial=length))
    header, conditions, chunk, signature = (whole[start:end] for start, end in itertools.pairwise(ends))
    if not signer.has_signed(bytes(signature).decode(errors="replace"), whole[length : ends[-2]]):
        raise DatasetError("episode: is not signed with the key of this run")
    try:
        text = bytes(conditions).decode()
    except UnicodeDecodeError as error:
        raise DatasetError("episode: its conditions are no UTF-8 text") from error
    return Delivery(Episode(header_from_json(bytes(header)), Chunk.parse(chunk)), text)


def make_episode(header: bytes | str, records_sha256: bytes, chunk: Chunk) -> Episode:
    """An episode from its parts as they travel and rest.

    Raises:
        DatasetError: If the header is not what `header_to_json` writes, or the hash not one in hexadecimal.
    """
    if not _SHA256.fullmatch(records_sha256):
        raise DatasetError(f"episode: SHA-256 {records_sha256[:80]!r}", expected="64 hexadecimal digits")
    return Episode(header_from_json(header), chunk, records_sha256.decode())
