"""The ROS graph, through a real router."""

import os
import time

import zenoh

from throwcollect.interfaces import get_message, get_service, type_hash
from throwcollect.ros import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from throwcollect.ros.embedded.keys import parse_token
from throwcollect.ros.embedded.session import open_session

String = get_message("std_msgs/msg/String")
Int32 = get_message("std_msgs/msg/Int32")
Trigger = get_service("std_srvs/srv/Trigger")


def test_nodes_see_what_others_have_as_soon_as_they_exist(rig):
    node = rig.node("a", namespace="/ns")
    node.create_publisher(String, "topic", 10)
    node.create_subscription(Int32, "~/other", lambda _: None, 10)
    node.create_service(Trigger, "service", lambda _, response: response)
    node.create_client(Trigger, "/called")
    seen = rig.node("b")
    assert seen.get_node_names_and_namespaces() == [("a", "/ns"), ("b", "/")]
    assert seen.get_node_names() == ["a", "b"]
    assert ("/ns/topic", [String.TYPE]) in seen.get_topic_names_and_types()
    assert ("/ns/a/other", [Int32.TYPE]) in seen.get_topic_names_and_types()
    assert ("/ns/service", [Trigger.TYPE]) in seen.get_service_names_and_types()
    assert ("/ns/topic", [String.TYPE]) in seen.get_publisher_names_and_types_by_node("a", "/ns")
    assert seen.get_subscriber_names_and_types_by_node("a", "/ns") == [("/ns/a/other", [Int32.TYPE])]
    assert seen.get_client_names_and_types_by_node("a", "/ns") == [("/called", [Trigger.TYPE])]
    services = [name for name, _ in seen.get_service_names_and_types_by_node("a", "/ns")]
    assert "/ns/a/set_parameters_atomically" in services
    assert (seen.count_publishers("/ns/topic"), seen.count_subscribers("/ns/topic")) == (1, 0)
    node.destroy_node()
    assert rig.spin(lambda: seen.get_node_names() == ["b"])
    assert seen.count_publishers("/ns/topic") == 0


def test_each_endpoint_of_a_topic_is_known_as_a_genuine_node_shows_it(rig):
    node = rig.node("a", namespace="/ns")
    qos = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(String, "t", qos)
    node.create_subscription(String, "t", print, QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
    seen = rig.node("b", namespace="/ns")
    (info,) = seen.get_publishers_info_by_topic("t")
    assert bytes(info.endpoint_gid) == publisher.gid
    assert str(info).splitlines() == [
        "Node name: a",
        "Node namespace: /ns",
        "Topic type: std_msgs/msg/String",
        f"Topic type hash: {type_hash(String.TYPE)}",
        "Endpoint type: PUBLISHER",
        f"GID: {publisher.gid.hex('.')}",
        "QoS profile:",
        "  Reliability: RELIABLE",
        "  History (Depth): KEEP_LAST (3)",
        "  Durability: TRANSIENT_LOCAL",
        "  Lifespan: Infinite",
        "  Deadline: Infinite",
        "  Liveliness: AUTOMATIC",
        "  Liveliness lease duration: Infinite",
    ]
    (info,) = seen.get_subscriptions_info_by_topic("/ns/t")
    assert (info.endpoint_type.name, info.qos_profile.reliability.name) == ("SUBSCRIPTION", "BEST_EFFORT")


def test_the_graph_is_complete_when_a_node_begins(rig):
    session, domain = rig.context().session, int(os.environ["ROS_DOMAIN_ID"])
    tokens = [session.liveliness().declare_token(f"@ros2_lv/{domain}/1a/{i}/{i}/NN/%/%/n{i}") for i in range(500)]
    time.sleep(0.3)
    assert len(rig.node("observer").get_node_names()) == len(tokens) + 1


def test_endpoints_match_by_name_and_type(rig):
    node = rig.node("a")
    publisher = node.create_publisher(String, "t", 10)
    node.create_subscription(Int32, "t", lambda _: None, 10)
    assert rig.spin(lambda: node.count_subscribers("t") == 1)
    assert publisher.get_subscription_count() == 0
    node.create_subscription(String, "t", lambda _: None, 10)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)


def test_other_domains_are_invisible(rig, monkeypatch):
    rig.node("a")
    monkeypatch.setenv("ROS_DOMAIN_ID", "232")
    assert rig.node("b").get_node_names() == ["b"]


def test_tokens_of_a_node_are_unique_and_carry_its_session(rig):
    node = rig.node("a")
    domain = node.context.get_domain_id()
    with open_session() as session:
        replies = list(session.liveliness().get(f"@ros2_lv/{domain}/**"))
    tokens = [parse_token(str(reply.ok.key_expr)) for reply in replies]
    assert {token.kind.value for token in tokens} == {"NN", "MP", "SS"}
    ids = [token.entity_id for token in tokens]
    assert len(set(ids)) == len(ids)
    assert {(token.node_id, token.session) for token in tokens} == {(min(ids), str(node.context.session.zid()))}
    assert all(str(token.session) == token.session.lower().lstrip("0") for token in tokens)


def test_malformed_tokens_are_ignored(rig):
    node, other = rig.node("a"), rig.context()
    domain = node.context.get_domain_id()
    odd = ["x", "1a/x/2/NN/%/%/b", "1a/0/0/ZZ/%/%/b", "1a/0/0/MP/%/%/b/%t", "1a/0/0/MP/%/%/b/%t/type/hash/nonsense"]
    tokens = [other.session.liveliness().declare_token(f"@ros2_lv/{domain}/{key}") for key in odd]
    assert rig.spin(lambda: node.count_publishers("/t") == 1)
    assert node.get_node_names() == ["a"]
    tokens[-1].undeclare()
    assert rig.spin(lambda: node.count_publishers("/t") == 0)
    assert isinstance(tokens[0], zenoh.LivelinessToken)
