"""Topics that a client hears and publishes."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.unit.serve.rosbridge.conftest import PATIENCE_S, Party, wait_for, wait_for_listener

from rclzenoh.interfaces import serialize
from throwcollect.ros import DurabilityPolicy, Node, QoSProfile, get_message
from throwcollect.serve.rosbridge import Bridge, topics
from throwcollect.serve.rosbridge.topics import RateLimit

String: Any = get_message("std_msgs/msg/String")
JointState: Any = get_message("sensor_msgs/msg/JointState")
PointStamped: Any = get_message("geometry_msgs/msg/PointStamped")
Image: Any = get_message("sensor_msgs/msg/Image")

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def words(node: Node, topic: str = "/words") -> Callable[..., None]:
    """A function that publishes a text once somebody listens."""
    publisher = node.create_publisher(String, topic, 10)

    def say(*texts: str) -> None:
        wait_for_listener(publisher)
        for text in texts:
            publisher.publish(String(data=text))

    return say


def data(party: Party) -> list[str]:
    return [each["msg"]["data"] for each in party.got() if each["op"] == "publish"]


def test_a_topic_that_is_published_later_is_heard_from_its_first_message(
    bridge: Bridge, party: Party, node: Node
) -> None:
    party.ask(op="subscribe", topic="/soon", type="std_msgs/String")
    wait_for(lambda: node.count_subscribers("/soon"))
    go_on = threading.Event()
    bridge.submit(lambda: (go_on.wait(PATIENCE_S), None)[1])
    publisher = node.create_publisher(String, "/soon", 10)
    wait_for_listener(publisher)
    publisher.publish(String(data="first"))
    # The bridge looks at the graph once a second, so it does that before it handles the message.
    time.sleep(1.1)
    go_on.set()
    assert party.next(op="publish")["msg"]["data"] == "first"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"topic": "/rosout", "type": "std_msgs/String"}, "/rosout is no std_msgs/msg/String; expected: rcl_inter"),
        ({"topic": "/sim_0/episode", "type": "std_msgs/UInt8MultiArray"}, "only the coordinator may have this"),
        ({"topic": "parameter_events"}, "it has the signed leases"),
    ],
)
def test_an_impossible_subscription_gets_an_error_status(party: Party, node: Node, asked: Any, said: str) -> None:
    wait_for(lambda: "/rosout" in party.call("rosapi/topics")["topics"])
    party.ask(op="subscribe", id="s", **asked)
    told = party.next(op="status")
    assert (told["level"], told["id"]) == ("error", "s")
    assert said in told["msg"]


def test_each_subscription_of_a_client_ends_by_its_id(party: Party, node: Node) -> None:
    say = words(node)
    for name in ("one", "two", "three"):
        party.ask(op="subscribe", id=name, topic="/words", type="std_msgs/String")
    party.ask(op="unsubscribe", id="one", topic="/words")
    say("a")
    party.next(msg={"data": "a"})
    party.ask(op="unsubscribe", topic="/words")
    party.ask(op="unsubscribe", topic="/words")
    assert "there is no subscription to /words" in party.next(op="status")["msg"]
    assert data(party) == ["a"]


def test_the_lowest_throttle_and_the_longest_queue_of_a_client_count(party: Party, node: Node) -> None:
    say = words(node)
    party.ask(op="subscribe", id="slow", topic="/words", type="std_msgs/String", throttle_rate=60_000)
    say("a", "b", "c")
    party.next(msg={"data": "a"})
    party.ask(op="subscribe", id="queue", topic="/words", throttle_rate=60_000, queue_length=2)
    party.call("rosapi/get_time")
    say(*"defgh")
    party.call("rosapi/get_time")
    assert data(party) == ["a"]
    # Messages that wait come when the shorter interval is over.
    party.ask(op="subscribe", id="fast", topic="/words", throttle_rate=1)
    party.next(msg={"data": "h"})
    assert data(party) == ["a", "g", "h"]
    party.ask(op="unsubscribe", id="fast", topic="/words")
    party.ask(op="unsubscribe", id="queue", topic="/words")
    party.call("rosapi/get_time")
    say("i", "j")
    party.call("rosapi/get_time")
    assert data(party)[3:] in ([], ["i"])


@pytest.mark.parametrize(("queue_length", "rate"), [(0, 25), (1, 30), (3, 30)])
def test_a_throttle_of_33_ms_passes_30_of_50_messages_a_second(
    monkeypatch: pytest.MonkeyPatch, queue_length: int, rate: int
) -> None:
    now = 100.0
    monkeypatch.setattr(topics, "time", SimpleNamespace(monotonic=lambda: now))
    waiting: list[tuple[float, Callable[[], None]]] = []
    sent: list[float] = []
    pace = RateLimit(lambda _: sent.append(now), lambda seconds, action: waiting.append((now + seconds, action)))
    pace.change(0.033, queue_length)
    sample: Any = "sample"
    for number in range(60 * 50):
        arrives = 100.0 + number * 0.02
        while waiting and waiting[0][0] <= arrives:
            now, action = waiting.pop(0)
            action()
        now = arrives
        pace.offer(sample)
    assert len(sent) == pytest.approx(60 * rate, abs=60)


def test_a_long_message_comes_in_fragments_of_the_requested_size(party: Party, node: Node) -> None:
    say = words(node)
    party.ask(op="subscribe", id="whole", topic="/words", type="std_msgs/String")
    party.ask(op="subscribe", id="cut", topic="/words", fragment_size=100)
    party.call("rosapi/get_time")
    say("ä" * 1000, "short")
    party.next(msg={"data": "short"})
    parts = [each for each in party.got() if each["op"] == "fragment"]
    assert {len(each["data"]) for each in parts[:-1]} == {100}
    assert {(each["total"], each["id"]) for each in parts} == {(len(parts), parts[0]["id"])}
    assert json.loads("".join(each["data"] for each in parts))["msg"] == {"data": "ä" * 1000}


def test_messages_come_as_cbor_with_typed_arrays_or_as_raw_bytes(party: Party, node: Node) -> None:
    publisher = node.create_publisher(JointState, "/states", 10)
    message = JointState(name=["a", "b"], position=[1.5, math.nan])
    for compression in ("cbor", "cbor-raw"):
        party.ask(op="subscribe", topic="/states", type="sensor_msgs/JointState", compression=compression)
        wait_for_listener(publisher)
        publisher.publish(message)
        found = party.next(op="publish")["msg"]
        if compression == "cbor":
            assert found["name"] == ["a", "b"]
            assert found["position"].tag == 86
            assert np.frombuffer(found["position"].value, "<f8") == pytest.approx([1.5, math.nan], nan_ok=True)
        else:
            assert found["bytes"] == serialize(message)
            assert found["secs"] + found["nsecs"] * 1e-9 == pytest.approx(time.time(), abs=60)
        party.ask(op="unsubscribe", topic="/states")
        wait_for(lambda: not publisher.get_subscription_count())


def listen_by(node: Node, kind: Any, topic: str, qos: Any = 10) -> list[Any]:
    heard: list[Any] = []
    node.create_subscription(kind, topic, heard.append, qos)
    return heard


def test_a_published_message_gets_defaults_for_missing_fields(party: Party, node: Node) -> None:
    heard = listen_by(node, Image, "/image")
    wait_for(lambda: "/image" in party.call("rosapi/topics")["topics"])
    party.ask(op="advertise", topic="image", type="sensor_msgs/Image")
    party.ask(op="publish", topic="image", msg={"data": "AQID", "header": {"stamp": {"secs": 7, "nsecs": 8}}})
    party.ask(op="publish", topic="/image", msg={"data": [1, 2], "width": 3})
    wait_for(lambda: len(heard) == 2)
    first, second = heard
    assert (bytes(first.data), first.header.stamp.sec, first.header.stamp.nanosec, first.width) == (b"\1\2\3", 7, 8, 0)
    assert (bytes(second.data), second.width) == (b"\1\2", 3)
    assert second.header.stamp.sec == pytest.approx(time.time(), abs=60)


def test_publishing_without_advertising_uses_the_type_of_the_topic(party: Party, node: Node) -> None:
    heard = listen_by(node, PointStamped, "/target")
    wait_for(lambda: "/target" in party.call("rosapi/topics")["topics"])
    party.ask(op="publish", topic="/target", msg={"point": {"x": 1, "y": None}})
    wait_for(lambda: heard)
    assert (heard[0].point.x, math.isnan(heard[0].point.y)) == (1.0, True)


def test_a_latched_message_reaches_late_subscribers_until_it_is_withdrawn(party: Party, node: Node) -> None:
    party.ask(op="advertise", topic="/map", type="std_msgs/String", latch=True)
    party.ask(op="publish", topic="/map", msg={"data": "here"})
    party.call("rosapi/get_time")
    heard = listen_by(node, String, "/map", LATCHED)
    wait_for(lambda: heard)
    assert node.count_publishers("/map") == 1
    party.ask(op="unadvertise", topic="/map")
    wait_for(lambda: not node.count_publishers("/map"))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"op": "publish", "topic": "/t", "msg": {"dat": 1}}, "dat: no such field; did you mean 'data'?"),
        ({"op": "publish", "topic": "/sim_0/episode", "msg": {}}, "only the coordinator may have this topic"),
    ],
)
def test_an_impossible_publication_gets_an_error_status(party: Party, asked: Any, said: str) -> None:
    party.ask(op="advertise", topic="/t", type="std_msgs/String")
    party.ask(id=9, **asked)
    told = party.next(op="status")
    assert (told["level"], told["id"]) == ("error", 9)
    assert said in told["msg"]


def test_a_leaving_client_withdraws_its_topics_services_and_actions(bridge: Bridge, node: Node) -> None:
    party = Party(bridge)
    party.ask(op="advertise", topic="/mine", type="std_msgs/String")
    party.ask(op="subscribe", topic="/yours", type="std_msgs/String")
    party.ask(op="advertise_service", service="/do", type="std_srvs/Trigger")
    party.ask(op="advertise_action", action="/act", type="control_msgs/FollowJointTrajectory")

    def there() -> list[bool]:
        services = dict(node.get_service_names_and_types())
        counts = node.count_publishers("/mine"), node.count_subscribers("/yours")
        return [*map(bool, counts), "/do" in services, "/act/_action/send_goal" in services]

    wait_for(lambda: all(there()))
    party.client.close()
    wait_for(lambda: not any(there()))
