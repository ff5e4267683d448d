"""Topics, services and nodes that a node sees of other nodes."""

from rclzenoh.interfaces import type_hash
from tests.contract.rig import ON_DDS, names_of
from throwcollect.ros import DurabilityPolicy, QoSProfile, ReliabilityPolicy, get_message, get_service

STRING, INT32, TRIGGER = "std_msgs/msg/String", "std_msgs/msg/Int32", "std_srvs/srv/Trigger"
String = get_message(STRING)
Int32 = get_message(INT32)
Trigger = get_service(TRIGGER)


def test_a_node_sees_topics_and_services_of_other_nodes(rig):
    node = rig.node("a", namespace="/ns")
    node.create_publisher(String, "topic", 10)
    node.create_subscription(Int32, "~/other", lambda _: None, 10)
    node.create_service(Trigger, "service", lambda _, response: response)
    seen = rig.node("b")
    assert rig.sees(lambda: sorted(seen.get_node_names_and_namespaces()) == [("a", "/ns"), ("b", "/")])
    assert names_of(seen) == ["a", "b"]
    assert rig.sees(lambda: ("/ns/topic", [STRING]) in seen.get_topic_names_and_types())
    assert ("/ns/a/other", [INT32]) in seen.get_topic_names_and_types()
    assert ("/ns/service", [TRIGGER]) in seen.get_service_names_and_types()
    assert ("/ns/topic", [STRING]) in seen.get_publisher_names_and_types_by_node("a", "/ns")
    assert seen.get_subscriber_names_and_types_by_node("a", "/ns") == [("/ns/a/other", [INT32])]
    services = [name for name, _ in seen.get_service_names_and_types_by_node("a", "/ns")]
    assert "/ns/a/set_parameters_atomically" in services
    assert (seen.count_publishers("/ns/topic"), seen.count_subscribers("/ns/topic")) == (1, 0)
    node.destroy_node()
    assert rig.spin(lambda: names_of(seen) == ["b"])
    assert seen.count_publishers("/ns/topic") == 0


def test_endpoint_infos_of_a_topic_look_like_those_of_genuine_nodes(rig):
    node = rig.node("a", namespace="/ns")
    qos = QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(String, "t", qos)
    node.create_subscription(String, "t", print, QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
    seen = rig.node("b", namespace="/ns")
    # DDS announces the node of an endpoint later than the endpoint itself.
    assert rig.sees(lambda: [info.node_name for info in seen.get_publishers_info_by_topic("t")] == ["a"])
    assert rig.sees(lambda: seen.count_subscribers("t") == 1)
    (info,) = seen.get_publishers_info_by_topic("t")
    assert (info.node_namespace, info.topic_type) == ("/ns", STRING)
    assert str(info.topic_type_hash) == type_hash(STRING)
    offered = info.qos_profile
    assert (offered.reliability.name, offered.durability.name) == ("RELIABLE", "TRANSIENT_LOCAL")
    # DDS does not announce the history of an endpoint.
    assert ON_DDS or (offered.history.name, offered.depth) == ("KEEP_LAST", 3)
    assert str(offered.lifespan) == str(offered.deadline) == str(offered.liveliness_lease_duration) == "Infinite"
    (info,) = seen.get_subscriptions_info_by_topic("/ns/t")
    assert info.qos_profile.reliability.name == "BEST_EFFORT"


def test_endpoints_match_by_name_and_type(rig):
    node, other = rig.node("a"), rig.node("b")
    publisher = node.create_publisher(String, "t", 10)
    # This node has another session, as DDS allows one type for each topic name of a session.
    other.create_subscription(Int32, "t", lambda _: None, 10)
    assert rig.spin(lambda: node.count_subscribers("t") == 1)
    assert publisher.get_subscription_count() == 0
    node.create_subscription(String, "t", lambda _: None, 10)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)


def test_a_node_does_not_see_nodes_of_another_domain(rig, monkeypatch):
    rig.node("a")
    monkeypatch.setenv("ROS_DOMAIN_ID", "232")
    assert names_of(rig.node("b")) == ["b"]
