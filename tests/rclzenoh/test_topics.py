"""Publishers and subscriptions, through a real router."""

import socket
import threading
import time

import numpy as np
import pytest
import zenoh
import zenoh.ext

from rclzenoh.context import Context
from rclzenoh.endpoint import Attachment, unpack
from rclzenoh.interfaces import get_message, serialize, type_hash
from rclzenoh.keys import data_key
from rclzenoh.session_config import client_config, router_config
from throwcollect.ros import DurabilityPolicy, HistoryPolicy, QoSProfile

String = get_message("std_msgs/msg/String")
JointState = get_message("sensor_msgs/msg/JointState")
VALID = Attachment(1, 0, bytes(16)).pack()
LATCHED = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_a_publisher_sends_samples_as_rmw_zenoh_does(rig):
    node = rig.node("talker", namespace="/talos")
    samples = []
    key = data_key(node.context.get_domain_id(), "/talos/chatter", String.TYPE, type_hash(String.TYPE))
    session = rig.context().session
    handler = zenoh.handlers.Callback(samples.append, indirect=False)
    session.declare_subscriber(key, handler)
    publisher = node.create_publisher(String, "chatter", 10)
    before = time.time_ns()
    assert rig.spin(lambda: publisher.publish(String(data="x")) or len(samples) > 2)
    first, second = (unpack(sample.attachment) for sample in samples[:2])
    assert second.sequence == first.sequence + 1
    (info,) = node.get_publishers_info_by_topic("chatter")
    assert first.gid == second.gid == bytes(info.endpoint_gid)
    assert before <= first.source_timestamp <= time.time_ns()
    assert samples[0].payload.to_bytes() == serialize(String(data="x"))
    # Advanced subscribers drop samples without a time stamp of the session.
    assert samples[0].timestamp is not None


@pytest.mark.parametrize("durability", list(DurabilityPolicy)[1:3])
def test_a_sample_for_another_key_is_ignored(rig, durability):
    qos = QoSProfile(depth=2, durability=durability)
    talker, listener = rig.node("talker"), rig.node("listener")
    heard = []
    listener.create_subscription(String, "t", lambda message: heard.append(message.data), qos)
    publisher, other = talker.create_publisher(String, "t", qos), talker.create_publisher(String, "other", qos)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)
    publisher.declared.put(serialize(String(data="stray")), attachment=VALID, encoding=other.encoding)
    publisher.publish(String(data="own"))
    assert rig.spin(lambda: "own" in heard)
    assert heard == ["own"]


@pytest.mark.parametrize("durability", list(DurabilityPolicy)[1:3])
def test_an_advanced_subscriber_of_zenoh_loses_no_message(rig, durability):
    qos = QoSProfile(depth=2000, history=HistoryPolicy.KEEP_ALL, durability=durability)
    node = rig.node("talker")
    key = data_key(node.context.get_domain_id(), "/t", String.TYPE, type_hash(String.TYPE))
    sequences = []
    session = rig.context().session
    handler = zenoh.handlers.Callback(lambda s: sequences.append(unpack(s.attachment).sequence), indirect=False)
    subscriber = zenoh.ext.declare_advanced_subscriber(session, key, handler)
    publisher = node.create_publisher(String, "t", qos)
    while not sequences:
        publisher.publish(String(data="first"))
        time.sleep(0.01)
    for i in range(2000):
        publisher.publish(String(data=str(i)))
    assert rig.spin(lambda: sequences[-1] - sequences[0] > 1999)
    assert np.all(np.diff(sequences) == 1)
    subscriber.undeclare()


def test_the_history_of_a_topic_is_announced_as_advanced_publishers_do(rig):
    node = rig.node("talker")
    node.create_publisher(String, "t", LATCHED)
    key = data_key(node.context.get_domain_id(), "/t", String.TYPE, type_hash(String.TYPE))
    session = rig.context().session
    announced = f"{key}/@adv/pub/{node.context.session.zid()}/*/_"
    # The token travels over the router, so it may arrive after the first look.
    assert rig.spin(lambda: len(list(session.liveliness().get(announced))) == 1)


def test_inputs_are_handled_in_order_of_arrival_across_topics(rig):
    listener, talker = rig.node("listener"), rig.node("talker")
    heard = []
    names = ["a", "b", "c"]
    for name in names:
        listener.create_subscription(String, name, lambda m: heard.append(m.data), 1000)
    publishers = [talker.create_publisher(String, name, 1000) for name in names]
    assert rig.spin(lambda: all(publisher.get_subscription_count() for publisher in publishers))
    order = [str(i) for i in range(300)]
    for i, text in enumerate(order):
        publishers[i * i % 3].publish(String(data=text))
    assert rig.spin(lambda: len(heard) == 300)
    assert heard == order


def test_a_discovered_subscriber_gets_the_next_message(rig):
    talker, listener = rig.node("talker"), rig.node("listener")
    seen = talker.context.graph
    for number in range(50):
        publisher, heard = talker.create_publisher(String, f"t{number}", 10), []
        thread = threading.Thread(target=listener.create_subscription, args=(String, f"t{number}", heard.append, 10))
        thread.start()
        assert seen.wait_for(publisher.get_subscription_count, 10)
        publisher.publish(String(data="first"))
        thread.join()
        assert rig.spin(lambda heard=heard: heard), f"the first message of {publisher.topic_name} is lost"


def test_garbage_on_a_topic_is_logged_once_and_does_not_stop_the_node(rig, capsys):
    node = rig.node("listener")
    heard = []
    node.create_subscription(JointState, "t", heard.append, 1000)
    publisher = rig.node("talker").create_publisher(JointState, "t", 1000)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)
    session = rig.context().session
    key = data_key(node.context.get_domain_id(), "/t", JointState.TYPE, type_hash(JointState.TYPE))
    good, attachment = serialize(JointState(position=[1.0])), Attachment(1, 0, bytes(16)).pack()
    random = np.random.default_rng(1)
    for _ in range(100):
        body = random.bytes(int(random.integers(0, 80)))
        session.put(key, b"\x00\x01\x00\x00" + body, attachment=attachment)
        session.put(key, body, attachment=attachment)
        session.put(key, good, attachment=body)
    session.put(key, good)
    # The last message comes from the same session, so it cannot overtake the garbage.
    last = serialize(JointState(position=[2.0]))
    assert rig.spin(
        lambda: session.put(key, last, attachment=attachment) or (heard and heard[-1].position.tolist() == [2.0])
    )
    assert capsys.readouterr().err.count("/t: ignored") == 1


def test_all_messages_arrive_whole_before_a_session_closes(rig):
    with socket.create_server(("127.0.0.1", 0)) as probe:
        # With such small buffers and the slow subscriber below, the sockets are full until the end.
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}#so_sndbuf=16384;so_rcvbuf=16384"
    heard = []

    def hear_slowly(sample):
        time.sleep(0.0005)
        heard.append(sample.payload.to_bytes())

    with zenoh.open(router_config(endpoint)), zenoh.open(client_config(endpoint)) as listening:
        talking = Context()
        talking.init(config=client_config(endpoint))
        node = rig.node("talker", context=talking)
        key = data_key(talking.get_domain_id(), "/t", String.TYPE, type_hash(String.TYPE))
        listening.declare_subscriber(key, zenoh.handlers.Callback(hear_slowly, indirect=False))
        publisher = node.create_publisher(String, "t", QoSProfile(history=HistoryPolicy.KEEP_ALL))
        assert rig.spin(lambda: publisher.publish(String(data="first")) or heard)
        messages = [serialize(String(data=f"{number:04}" * 400)) for number in range(700)]
        for message in messages:
            publisher.publish(message)
        node.destroy_node()
        talking.shutdown()
        deadline = time.monotonic() + 60
        while heard[-1] != messages[-1] and time.monotonic() < deadline:
            time.sleep(0.01)
        assert heard[-len(messages) :] == messages
