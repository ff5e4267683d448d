from __future__ import annotations

import io
import struct
import zlib
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.records import Chunk as McapChunk
from mcap.records import Message, MessageIndex

from throwcollect.config.schema import Config
from throwcollect.episode.channels import Channels
from throwcollect.episode.chunk import Chunk
from throwcollect.episode.message_table import ChunkEncoder, MessageTable
from throwcollect.episode.record import Samples
from throwcollect.errors import DatasetError
from throwcollect.robots.description import full_description

URDF = full_description(Config())
ALL = ["joint_states", "ball/odometry", "controller_state", "tf", "clock"]


@pytest.fixture
def encoder() -> ChunkEncoder:
    return ChunkEncoder(Channels(Config(), URDF), level=1)


@pytest.fixture
def full() -> ChunkEncoder:
    return ChunkEncoder(Channels(Config.model_validate({"record": {"topics": ALL}}), URDF), level=1)


@pytest.fixture
def targets(make_set_points: Any) -> dict[str, Any]:
    return {name: make_set_points(name, 50) for name in ("arm_right_controller", "torso_controller")}


def messages_of(contents: bytes) -> list[tuple[int, Message]]:
    """Offset and fields of each record, as the mcap library reads them."""
    found, offset = [], 0
    while offset < len(contents):
        opcode, length = struct.unpack_from("<BQ", contents, offset)
        assert opcode == 0x05
        found.append((offset, Message.read(ReadDataStream(io.BytesIO(contents[offset + 9 :])), length)))
        offset += 9 + length
    return found


def test_a_chunk_has_one_message_per_channel_and_sample(full: ChunkEncoder, make_samples: Any, targets: Any) -> None:
    samples = make_samples(50)
    messages = [message for _, message in messages_of(full.encode(samples, targets)[0].contents)]
    assert [message.channel_id for message in messages] == [3, 4, 5, 6, 8, 11] * 50
    assert [message.sequence for message in messages[::6]] == list(range(50))
    assert [message.log_time for message in messages[3::6]] == samples.stamps_ns.tolist()
    assert all(message.publish_time == message.log_time for message in messages)


def test_messages_made_topic_by_topic_have_the_bytes_of_the_chunk(
    full: ChunkEncoder, make_samples: Any, targets: Any
) -> None:
    """What a listener receives live is what the dataset holds."""
    samples = make_samples(50)
    table = MessageTable(full.encode(samples, targets)[0].contents, 50)
    topics = {
        3: "/joint_states",
        4: "/ball/odometry",
        5: "/clock",
        6: "/tf",
        8: "/arm_right_controller/controller_state",
        11: "/torso_controller/controller_state",
    }
    channels = Channels(Config.model_validate({"record": {"topics": ALL}}), URDF)
    recorded = {topic.name: topic for topic in channels.recorded.values()}
    for channel, topic in topics.items():
        assert np.array_equal(recorded[topic].encode(samples, targets), table.messages(channel))


@pytest.mark.parametrize("count", [1, 2, 500])
def test_samples_can_be_read_back_from_a_chunk(encoder: ChunkEncoder, make_samples: Any, count: int) -> None:
    samples = make_samples(count)
    read = MessageTable(encoder.encode(samples)[0].contents, count).samples
    for field in fields(Samples):
        assert np.allclose(getattr(samples, field.name), getattr(read, field.name), rtol=0, atol=1e-14)
    for name in ("stamps_ns", "position", "velocity", "effort", "object_position", "object_orientation_xyzw"):
        sent, got = getattr(samples, name), getattr(read, name)
        assert np.array_equal(sent, got)
        assert sent.dtype == got.dtype


def test_the_mcap_library_can_read_the_record_of_a_chunk(encoder: ChunkEncoder, make_samples: Any) -> None:
    chunk = encoder.encode(make_samples(20))[0]
    read = McapChunk.read(ReadDataStream(io.BytesIO(chunk.record()[9:])))
    assert (read.compression, read.data, read.uncompressed_size) == ("zstd", chunk.data, len(chunk.decompress()))
    assert (read.message_start_time, read.message_end_time) == (10**10, 10**10 + 19 * 4_000_000)
    assert read.uncompressed_crc == zlib.crc32(chunk.decompress())
    assert Chunk.parse(chunk.record()) == replace(chunk, records_sha256="")


def test_message_indexes_point_at_the_messages(encoder: ChunkEncoder, make_samples: Any) -> None:
    contents = encoder.encode(make_samples(20))[0].contents
    table = MessageTable(contents, 20)
    for channel in (3, 4):
        index = MessageIndex.read(ReadDataStream(io.BytesIO(table.message_indexes[channel][9:])))
        assert index.records == [
            (message.log_time, at) for at, message in messages_of(contents) if message.channel_id == channel
        ]


@pytest.mark.parametrize("at", [0, 45, -1])
def test_a_chunk_record_with_a_changed_or_missing_byte_is_refused(
    encoder: ChunkEncoder, make_samples: Any, at: int
) -> None:
    record = bytearray(encoder.encode(make_samples(20))[0].record())
    if at == -1:
        del record[-1]
    else:
        record[at] ^= 0x11
    with pytest.raises(DatasetError, match="chunk: "):
        Chunk.parse(bytes(record)).decompress()


def test_a_chunk_whose_data_or_crc_is_wrong_is_not_decompressed(encoder: ChunkEncoder, make_samples: Any) -> None:
    chunk = encoder.encode(make_samples(20))[0]
    bomb = zstandard.ZstdCompressor().compress(bytes(50_000_000))
    for data, message in [
        (chunk.data[:-1], "cannot be decompressed"),
        (chunk.data + b"x", "cannot be decompressed"),
        (b"", "cannot be decompressed"),
        (bomb, "holds 50000000 bytes"),
    ]:
        with pytest.raises(DatasetError, match=message):
            replace(chunk, data=data).decompress()
    with pytest.raises(DatasetError, match="CRC differs"):
        replace(chunk, crc=chunk.crc ^ 1).decompress()


def test_records_that_do_not_fit_the_number_of_samples_are_refused(encoder: ChunkEncoder, make_samples: Any) -> None:
    contents = encoder.encode(make_samples(20))[0].contents
    row = len(contents) // 20
    for broken, count, message in [
        (contents, 0, "are not the records of 0 samples"),
        (contents, 19, "are not the records of 19 samples"),
        (contents, 40, "not one message per channel"),
        (contents, 10, "not one message per channel"),
        (b"", 1, "are not the records"),
        (b"\x05" + bytes(30), 1, "not one message per channel"),
        (contents[:row] + bytes(3), 1, "cut off"),
    ]:
        with pytest.raises(DatasetError, match=message):
            MessageTable(broken, count)
