"""Lists of messages of sensors, which may differ in size. `test_chunk` tests the tables of samples."""

from __future__ import annotations

import pytest
from mcap.records import Message

from rclzenoh.interfaces import get_message, serialize
from throwcollect.episode.chunk import count_indexed, encode_records
from throwcollect.episode.message_table import MessageList
from throwcollect.errors import DatasetError

LATE_NS = 3_000_000_000


def make_image(stamp_ns: int, text: str) -> bytes:
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    stamp = get_message("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)
    header = get_message("std_msgs/msg/Header")(stamp=stamp, frame_id=text)
    return bytes(serialize(get_message("sensor_msgs/msg/CompressedImage")(header=header, format="", data=[1, 2])))


@pytest.fixture
def contents() -> bytes:
    times = [5, 1_000_000_000, 1_999_999_999]
    return encode_records(
        *(Message(100 + n % 2, time, make_image(time, "a" * n * 7), time, n // 2) for n, time in enumerate(times))
    )


def test_messages_of_different_sizes_are_listed_one_after_the_other(contents: bytes) -> None:
    messages = MessageList(contents)
    assert len(messages) == 3
    assert messages.channels == (100, 101)
    assert messages.stamps_ns.tolist() == messages.headers["log_time"].tolist() == [5, 1_000_000_000, 1_999_999_999]
    assert messages.headers["sequence"].tolist() == [0, 0, 1]
    assert [count_indexed(messages.message_index(channel)) for channel in messages.channels] == [2, 1]


def test_bytes_that_are_no_messages_with_a_header_are_refused(contents: bytes) -> None:
    short = encode_records(Message(100, 5, b"\0\1\0\0abc", 5, 0))
    for broken, problem in [
        (b"", "holds no messages"),
        (contents[:-1], "not a message with a header"),
        (contents + bytes(3), "cut off"),
        (contents + b"\x06" + bytes(40), "not a message with a header"),
        (short, "not a message with a header at byte 0"),
    ]:
        with pytest.raises(DatasetError, match=problem):
            MessageList(broken)
