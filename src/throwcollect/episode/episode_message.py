"""The one message that carries an episode from a simulation to the coordinator: std_msgs/UInt8MultiArray.

Its layout names the parts of its data: ``header``, an `EpisodeHeader` in JSON; ``result``, the result of the trial in
JSON; ``conditions``, the conditions of the episode in lines; ``hash``, the SHA-256 of the records of each chunk as 32
bytes; ``chunk``, its MCAP Chunk records, each with its Message Index records behind it; and ``signature``, which covers
all parts before it. The coordinator trusts a sender who has the key of the run, so it does not decompress, hash or
judge the episode again.

The same message carries a refusal: its header and its chunk are empty, its result is the reason, and its conditions
are the number of the trial that was refused.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError

from rclzenoh.interfaces import deserialize, get_message, serialize
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_table import MessageTable
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import DatasetError
from throwcollect.run_key import Signer

_TYPE = "std_msgs/msg/UInt8MultiArray"
_PARTS = ("header", "result", "conditions", "hash", "chunk", "signature")
_HEADER = TypeAdapter(EpisodeHeader)
_LONGEST_NAME = 256
"""Most characters of a recorded name that a message shows."""


@dataclass(eq=False)
class Episode:
    """The recording of one trial, in a message and on disk: a header, and a chunk that is decompressed when needed.

    The chunk holds one message per channel and sample.

    Attributes:
        header: The facts besides the samples.
        chunk: The recorded messages, with their hash.
        sensors: What sensors saw of the samples, in further chunks with their hashes and message indexes; the digest
            does not cover it.
        result: Result of the trial in JSON; empty if no simulation has judged the episode.
        conditions: Conditions of the episode in lines; empty if it comes from a file.
    """

    header: EpisodeHeader
    chunk: Chunk
    sensors: tuple[Chunk, ...] = field(default=(), kw_only=True)
    result: str = field(default="", kw_only=True)
    conditions: str = field(default="", kw_only=True)

    @cached_property
    def header_json(self) -> str:
        """The header as `header_to_json` writes it."""
        return header_to_json(self.header)

    @cached_property
    def table(self) -> MessageTable:
        """The message records of the chunk as a table."""
        return MessageTable(self.chunk.contents, self.header.samples)

    def samples(self, joints: Sequence[str] | None = None) -> Samples:
        """Read the samples; `joints` must have been recorded, in this order."""
        if joints is not None and tuple(joints) != self.table.joints:
            found = ", ".join(self.table.joints)[:_LONGEST_NAME]
            raise DatasetError(f"chunk: joint states of {found}", expected=", ".join(joints))
        return self.table.samples

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
            b"".join(bytes.fromhex(chunk.records_sha256) for chunk in (handed.chunk, *handed.sensors)),
            b"".join(
                chunk.record() + b"".join(chunk.indexes.values())
                for chunk in (replace(handed.chunk, indexes=handed.message_indexes), *handed.sensors)
            ),
        ]
    parts.append(signer.sign(*parts).encode())
    dimension, layout = get_message("std_msgs/msg/MultiArrayDimension"), get_message("std_msgs/msg/MultiArrayLayout")
    named = zip(_PARTS, map(len, parts), strict=True)
    dimensions = [dimension(label=name, size=size, stride=size) for name, size in named]
    return serialize(get_message(_TYPE)(layout=layout(dim=dimensions), data=np.frombuffer(b"".join(parts), np.uint8)))


def unpack(message: bytes, signer: Signer) -> Episode | TrialRefusal:
    """Read the message that `pack` writes, without decompressing chunks."""
    try:
        array = deserialize(message, get_message(_TYPE))
    except ValueError as error:
        raise DatasetError(f"episode: {error}") from error
    data, sizes = memoryview(array.data), [part.size for part in array.layout.dim]
    if tuple(part.label for part in array.layout.dim) != _PARTS or sum(sizes) != len(data):
        raise DatasetError(f"episode: not an array of the parts {', '.join(_PARTS)}")
    ends = list(itertools.accumulate(sizes, initial=0))
    *parts, signature = (data[start:end] for start, end in itertools.pairwise(ends))
    if not signer.has_signed(bytes(signature).decode(errors="replace"), data[: ends[-2]]):
        raise DatasetError("episode: is not signed with the key of this run")
    header, result, conditions, hashes, chunks = parts
    try:
        texts = bytes(result).decode(), bytes(conditions).decode()
        if not header:
            return TrialRefusal(trial=int(texts[1]), reason=texts[0])
    except ValueError as error:
        raise DatasetError("episode: its result or its conditions cannot be read") from error
    recorded, *sensors = Chunk.parse_run(
        chunks, [hashes[start : start + 32].hex() for start in range(0, len(hashes), 32)]
    )
    facts = header_from_json(bytes(header))
    return Episode(facts, recorded, sensors=tuple(sensors), result=texts[0], conditions=texts[1])
