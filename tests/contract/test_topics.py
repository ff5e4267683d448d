"""Publishers and subscriptions."""

import time

import pytest

from rclzenoh.interfaces import message_class, serialize
from tests.contract.rig import ON_RCLPY, InvalidHandle, choose_words
from throwcollect.ros import DurabilityPolicy, QoSProfile, ReliabilityPolicy, get_message

String = get_message("std_msgs/msg/String")
JointState = get_message("sensor_msgs/msg/JointState")
LATCHED = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_messages_arrive_in_order_at_a_node_in_another_session(rig):
    talker, listener = rig.node("talker"), rig.node("listener")
    heard = []
    listener.create_subscription(JointState, "joints", lambda m: heard.append(list(m.position)), 100)
    publisher = talker.create_publisher(JointState, "joints", 100)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)
    for i in range(50):
        publisher.publish(JointState(position=[float(i), 0.0]))
    assert rig.spin(lambda: len(heard) == 50)
    assert heard == [[float(i), 0.0] for i in range(50)]


def test_nodes_of_one_session_hear_each_other(rig):
    context = rig.context()
    talker, listener = rig.node("talker", context=context), rig.node("listener", context=context)
    heard = []
    listener.create_subscription(String, "/chatter", heard.append, 10)
    talker.create_publisher(String, "/chatter", 10).publish(String(data="hello"))
    assert rig.spin(lambda: heard)
    assert heard == [String(data="hello")]


def test_raw_bytes_are_published_and_received_unchanged(rig):
    node = rig.node("node")
    heard = []
    node.create_subscription(String, "t", heard.append, 10, raw=True)
    data = serialize(message_class("std_msgs/msg/String")(data="raw"))
    node.create_publisher(String, "t", 10).publish(data)
    assert rig.spin(lambda: heard)
    assert heard == [data]


def test_messages_of_another_type_are_not_published(rig):
    publisher = rig.node("node").create_publisher(String, "t", 10)
    with pytest.raises(
        TypeError,
        match=choose_words(
            embedded="expected std_msgs/msg/String or bytes, got JointState",
            rclpy="Expected .*String.*, got .*JointState",
        ),
    ):
        publisher.publish(JointState())


# On DDS, only reliable late subscribers get earlier messages.
@pytest.mark.parametrize(
    "reliability", [ReliabilityPolicy.RELIABLE] + ([] if ON_RCLPY else [ReliabilityPolicy.BEST_EFFORT])
)
def test_a_late_subscriber_gets_the_last_messages_of_a_transient_local_topic(rig, reliability):
    qos = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=reliability)
    talker, listener = rig.node("talker"), rig.node("listener")
    publisher = talker.create_publisher(String, "t", qos)
    for text in "abc":
        publisher.publish(String(data=text))
    rig.rest()  # Otherwise, a message still on its way would be heard as well.
    heard = []
    listener.create_subscription(String, "t", lambda m: heard.append(m.data), qos)
    assert rig.spin(lambda: len(heard) == 2)
    publisher.publish(String(data="d"))
    assert rig.spin(lambda: len(heard) == 3)
    assert heard == ["b", "c", "d"]


def test_a_late_publisher_of_a_transient_local_topic_is_heard_once(rig):
    listener = rig.node("listener")
    heard = []
    listener.create_subscription(String, "t", lambda m: heard.append(m.data), LATCHED)
    publisher = rig.node("talker").create_publisher(String, "t", LATCHED)
    publisher.publish(String(data="a"))
    assert rig.spin(lambda: heard)
    rig.rest()
    assert heard == ["a"]


def test_a_full_subscription_drops_its_oldest_messages(rig):
    node, talker = rig.node("listener"), rig.node("talker")
    heard, marks = [], []
    node.create_subscription(String, "t", lambda m: heard.append(m.data), 3)
    node.create_subscription(String, "end", marks.append, 1, raw=True)
    publisher, end = talker.create_publisher(String, "t", 100), talker.create_publisher(String, "end", 1)
    assert rig.spin(lambda: publisher.get_subscription_count() and end.get_subscription_count())
    for i in range(20):
        publisher.publish(String(data=str(i)))
    end.publish(String())
    time.sleep(0.2)
    # On DDS, messages of one publisher may overtake earlier ones of another publisher.
    assert rig.spin(lambda: marks and "19" in heard)
    rig.rest(0.05)
    assert heard == ["17", "18", "19"]


def test_destroyed_endpoints_leave_the_graph_and_are_silent(rig):
    node, other = rig.node("node"), rig.node("other")
    heard = []
    subscription = node.create_subscription(String, "t", heard.append, 10)
    publisher = other.create_publisher(String, "t", 10)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)
    assert node.destroy_subscription(subscription)
    assert not node.destroy_subscription(subscription)
    assert rig.spin(lambda: publisher.get_subscription_count() == 0)
    publisher.publish(String())
    rig.rest(0.05)
    assert heard == []
    other.destroy_publisher(publisher)
    with pytest.raises(InvalidHandle, match=choose_words(embedded="destroyed", rclpy="destruction was requested")):
        publisher.publish(String())
