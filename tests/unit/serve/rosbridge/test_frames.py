"""Frames of rosbridge in each of their formats, and malformed frames."""

from __future__ import annotations

import base64
import json
import math
import random as random_numbers
from functools import cache
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.rclzenoh.interfaces.test_cdr import random_message
from tests.unit.serve.rosbridge.conftest import Party

from rclzenoh.interfaces import deserialize, message_class, serialize
from rclzenoh.interfaces.catalog import INTERFACES
from throwcollect.errors import ConfigError
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.bridge import Bridge, Sample
from throwcollect.serve.rosbridge.codec import (
    LONGEST_FRAME,
    Reassembly,
    cut,
    encode,
    json_text,
    plain_values,
    read_frame,
)
from throwcollect.serve.rosbridge.operations import Fragment, read_operation


@cache
def message_names() -> list[str]:
    """Every message that is known, with the requests and responses of services."""
    parts = ("Request", "Response", "Goal", "Result", "Feedback", "FeedbackMessage")
    return sorted(name for name in INTERFACES if "/msg/" in name or name.rpartition("_")[2] in parts)


def read_array(tag: cbor2.CBORTag, _immutable: bool) -> Any:
    kinds = {64: "u1", 69: "<u2", 70: "<u4", 71: "<u8", 72: "i1", 77: "<i2", 78: "<i4", 79: "<i8", 85: "<f4", 86: "<f8"}
    return np.frombuffer(tag.value, kinds[tag.tag])


def content(frame: str | bytes) -> Any:
    """The message in a frame, as a client would fill it in: typed arrays, bytes and Base64 as they are."""
    return (read_frame(frame) if isinstance(frame, str) else cbor2.loads(frame, tag_hook=read_array))["msg"]


def test_json_cbor_and_raw_bytes_of_every_message_are_equivalent() -> None:
    assert len(message_names()) > 250
    random = random_numbers.Random(16)
    for name in message_names():
        message = random_message(name, random)
        sample = Sample(serialize(message), message_class(name), 0)
        frames = {form: sample.frame("/t", form) for form in ("none", "cbor", "cbor-raw")}
        raw = cbor2.loads(frames["cbor-raw"])["msg"]["bytes"]
        assert deserialize(raw, message_class(name)) == message, name
        for form in ("none", "cbor"):
            again = message_class(name)()
            fill(again, content(frames[form]))
            assert again == message, (name, form)


def test_octets_and_numbers_are_written_as_in_rosbridge() -> None:
    values: dict[str, Any] = {
        "std_msgs/msg/UInt8MultiArray": (b"\0\1", base64.b64encode(b"\0\1").decode(), b"\0\1"),
        "std_msgs/msg/ByteMultiArray": (b"\0\1", [0, 1], b"\0\1"),
        "std_msgs/msg/Int64MultiArray": ([-(2**63)], [-(2**63)], cbor2.CBORTag(79, b"\0" * 7 + b"\x80")),
        "std_msgs/msg/UInt16MultiArray": ([258], [258], cbor2.CBORTag(69, b"\2\1")),
        "std_msgs/msg/Float32MultiArray": (
            [1.5, math.inf],
            [1.5, None],
            cbor2.CBORTag(85, np.float32([1.5, np.inf]).tobytes()),
        ),
        "std_msgs/msg/Float64": (math.nan, None, math.nan),
    }
    for name, (value, in_json, in_cbor) in values.items():
        message = message_class(name)(data=value)
        assert json.loads(json_text(plain_values(message)))["data"] == in_json
        found = cbor2.loads(encode(plain_values(message, "cbor"), "cbor"))["data"]
        assert found == in_cbor or (found != found and in_cbor != in_cbor)


@pytest.mark.parametrize("kind", ["Int32", "Float64", "UInt8"])
@pytest.mark.parametrize("value", [True, [True], [1, False], np.array([True])])
def test_truth_values_are_no_numbers(kind: str, value: Any) -> None:
    message = message_class(f"std_msgs/msg/{kind}" + ("" if value is True else "MultiArray"))()
    with pytest.raises(ConfigError, match=r"data: should be .*, got "):
        fill(message, {"data": value})


@pytest.mark.parametrize(
    ("frame", "said"),
    [
        ("", "a frame is no JSON"),
        ('{"op": "png"}', "Input tag 'png' found using 'op' does not match any of the expected tags"),
        ("[" * 100_000, "a frame is no JSON"),
        (b'{"op": "publish", "msg": {}}', "publish.topic: Field required"),
        ('{"op": "fragment", "id": "a", "num": 1, "total": 1, "data": ""}', "num should be below total"),
        ('{"op": "set_level", "level": "debug"}', "set_level.level: Input should be 'none', 'error', 'warning' or"),
    ],
)
def test_a_malformed_frame_gets_an_error_status(party: Party, frame: str | bytes, said: str) -> None:
    party.client.receive(frame)
    told = party.next(op="status")
    assert told["level"] == "error"
    assert said in told["msg"]


@settings(max_examples=15)
@given(
    frame=st.one_of(st.binary(max_size=60), st.text(max_size=60), st.dictionaries(st.text(), st.none()).map(json.dumps))
)
def test_any_frame_is_read_or_refused(frame: str | bytes) -> None:
    try:
        read_operation(read_frame(frame))
    except ConfigError:
        return


def test_status_messages_come_up_to_the_requested_level(party: Party) -> None:
    for level in ("none", "error", "warning"):
        party.ask(op="set_level", level=level)
        party.ask(op="nothing", id=level)
        party.ask(op="unadvertise", id=level, topic="/x")
    party.call("rosapi/get_time")
    told = [(each["id"], each["level"]) for each in party.got() if each["op"] == "status"]
    assert told == [("error", "error"), ("warning", "error"), ("warning", "warning")]


def test_fragments_in_any_order_become_a_frame(bridge: Bridge) -> None:
    reader = Party(bridge, read_only=True)
    frame = json_text({"op": "call_service", "id": "whole", "service": "/rosapi/get_ros_version"})
    parts = list(cut(frame, 7))
    for each in [*parts[::-2], parts[-1]]:
        reader.client.receive(each)
    reader.call("rosapi/get_time")
    assert "whole" not in [each["id"] for each in reader.got()]
    for each in parts:
        reader.client.receive(each)
    assert reader.next(id="whole")["values"]["version"] == 2
    reader.client.close()


def test_parts_of_a_frame_that_are_too_long_together_are_rejected() -> None:
    whole, half = Reassembly(), "x" * (LONGEST_FRAME // 2)

    def add(number: int, total: int, data: str, name: str = "a") -> str | None:
        return whole.add(Fragment(op="fragment", id=name, num=number, total=total, data=data))

    assert add(0, 2, half) is None
    with pytest.raises(ConfigError, match=f"should have at most {LONGEST_FRAME} characters"):
        add(0, 2, half, name="b")
    assert add(1, 2, "y") == f"{half}y"
    assert add(0, 2, "x" * (LONGEST_FRAME - 100)) is None
