"""The one message that carries an episode from a simulation to the coordinator: std_msgs/UInt8MultiArray.

Its layout names the parts of its data: ``header``, an `EpisodeHeader` in JSON; ``result``, the result of the trial in
JSON; ``conditions``, the conditions of the episode in lines; ``hash``, the SHA-256 of the records of the chunk as 32
bytes; ``chunk``, its MCAP Chunk record with its Message Index records behind it; and ``signature``, which covers all
parts before it. The coordinator trusts a sender who has the key of the run, so it does not decompress, hash or judge
the episode again.

The same message carries a refusal: its header and its chunk are empty, its result is the reason, and its conditions
are the number of the trial that was refused.
"""

from __future__ import annotations

import hashlib
import itertools
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError

from rclzenoh.interfaces import get_message
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_layout import MessageLayout
from throwcollect.episode.message_table import MessageTable
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.episode.topics import Rows
from throwcollect.errors import DatasetError
from throwcollect.run_key import Signer

_PARTS = ("header", "result", "conditions", "hash", "chunk", "signature")
_HEADER = TypeAdapter(EpisodeHeader)
_LONGEST_NAME = 256
"""Most characters of a recorded name that a message shows."""
_COUNT = struct.Struct("<I")


@dataclass(eq=False)
class Episode:
    """The recording of one trial, in a message and on disk: a header, and a chunk that is decompressed when needed.

    The chunk holds one message per channel and sample.

    Attributes:
        header: The facts besides the samples.
        chunk: The recorded messages, with their hash.
        result: Result of the trial in JSON; empty if no simulation has judged the episode.
        conditions: Conditions of the episode in lines; empty if it comes from a file.
    """

    header: EpisodeHeader
    chunk: Chunk
    result: str = field(default="", kw_only=True)
    conditions: str = field(default="", kw_only=True)

    @cached_property
    def header_json(self) -> str:
        """The header as `header_to_json` writes it."""
        return header_to_json(self.header)

    @cached_property
    def table(self) -> MessageTable:
        """The message records of the chunk as a table."""
        table = MessageTable(self.chunk.contents, self.header.samples)
        table.check_rows()
        return table

    def samples(self, joints: Sequence[str] | None = None) -> Samples:
        """Read the samples; `joints` must have been recorded, in this order."""
        self._check_joints(self.table.joints if joints is None else joints)
        return self.table.samples

    def rows(self, joints: Sequence[str]) -> Rows:
        """View the samples in place, see `MessageTable.rows`; `joints` must have been recorded, in this order."""
        try:
            return self.table.rows(tuple(joints))
        except DatasetError:
            self._check_joints(joints)
            raise

    def _check_joints(self, joints: Sequence[str]) -> None:
        if tuple(joints) != self.table.joints:
            found = ", ".join(self.table.joints)[:_LONGEST_NAME]
            raise DatasetError(f"chunk: joint states of {found}", expected=", ".join(joints))

    @cached_property
    def message_indexes(self) -> Mapping[int, bytes]:
        """The MCAP Message Index records of the chunk, by channel."""
        return self.chunk.indexes or self.table.message_indexes

    @cached_property
    def digest(self) -> str:
        """SHA-256 over the header's JSON, one zero byte and the hash of the chunk as 32 bytes, in hexadecimal."""
        records = bytes.fromhex(self.chunk.records_sha256)
        return hashlib.sha256(self.header_json.encode() + b"\0" + records).hexdigest()


def header_to_json(header: EpisodeHeader) -> str:
    """Write a header in JSON: keys in the order of their declaration, no blanks; equal headers give equal text."""
    return _HEADER.dump_json(header).decode()


def header_from_json(text: bytes | str) -> EpisodeHeader:
    """Read the text that `header_to_json` writes, or one that differs from it only in blanks."""
    try:
        return _HEADER.validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise DatasetError(f"episode header: {place}: {first['msg']}; {error.error_count()} problems in all") from error


@cache
def _make_layout() -> MessageLayout:
    dimension = get_message("std_msgs/msg/MultiArrayDimension")
    layout = get_message("std_msgs/msg/MultiArrayLayout")(dim=[dimension(label=part) for part in _PARTS])
    message = get_message("std_msgs/msg/UInt8MultiArray")(layout=layout)
    return MessageLayout(message, [f"layout.dim.{n}.{key}" for n in range(len(_PARTS)) for key in ("size", "stride")])


class TrialRefusal(NamedTuple):
    """A refusal of a simulation to do a trial."""

    trial: int
    reason: str


def pack(handed: Episode | TrialRefusal, signer: Signer) -> bytes:
    """Encode the CDR message that carries an episode or a refusal."""
    if isinstance(handed, TrialRefusal):
        parts = [b"", handed.reason.encode(), str(handed.trial).encode(), b"", b""]
    else:
        parts = [
            handed.header_json.encode(),
            handed.result.encode(),
            handed.conditions.encode(),
            bytes.fromhex(handed.chunk.records_sha256),
            b"".join((handed.chunk.record(), *handed.message_indexes.values())),
        ]
    signature = signer.sign(*parts).encode()
    return b"".join((_encode_prefix([*map(len, parts), len(signature)]), *parts, signature))


def _encode_prefix(sizes: list[int]) -> bytes:
    """Encode everything before the data: the layout, and at the end the size of the data."""
    prefix = bytearray(_make_layout().template)
    np.frombuffer(prefix, _make_layout().dtype)[0] = tuple(size for size in sizes for _ in ("size", "stride"))
    # A stranger's message may have sizes whose sum does not fit; such a message is refused later, by its length.
    _COUNT.pack_into(prefix, len(prefix) - _COUNT.size, sum(sizes) % 2**32)
    return bytes(prefix)


def unpack(message: bytes, signer: Signer) -> Episode | TrialRefusal:
    """Read the message that `pack` writes, without decompressing chunks."""
    layout = _make_layout()
    length = len(layout.template)
    if len(message) < length:
        raise DatasetError(f"episode: a message of {len(message)} bytes", expected=f"at least {length}")
    sizes = list(np.frombuffer(message, layout.dtype, count=1)[0].item()[::2])
    # Names of the parts, strides and the size of the data follow from the sizes, so one comparison checks them all.
    if message[:length] != _encode_prefix(sizes):
        raise DatasetError(f"episode: not a UInt8MultiArray of the parts {', '.join(_PARTS)}")
    # Some RMWs hand over messages with padding behind them.
    if len(message) < length + sum(sizes):
        raise DatasetError(f"episode: {len(message) - length} bytes of data", expected=f"{sum(sizes)} as announced")
    whole = memoryview(message)
    ends = list(itertools.accumulate(sizes, initial=length))
    *parts, signature = (whole[start:end] for start, end in itertools.pairwise(ends))
    if not signer.has_signed(bytes(signature).decode(errors="replace"), whole[length : ends[-2]]):
        raise DatasetError("episode: is not signed with the key of this run")
    header, result, conditions, records_hash, chunk = parts
    try:
        texts = bytes(result).decode(), bytes(conditions).decode()
        if not header:
            return TrialRefusal(trial=int(texts[1]), reason=texts[0])
    except ValueError as error:
        raise DatasetError("episode: its result or its conditions cannot be read") from error
    recorded = Chunk.parse_indexed(chunk, records_hash.hex())
    return Episode(header_from_json(bytes(header)), recorded, result=texts[0], conditions=texts[1])
