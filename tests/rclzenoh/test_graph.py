"""The ROS graph, through a real router."""

import os

import zenoh

from rclzenoh.context import open_session
from rclzenoh.interfaces import get_message, get_service
from rclzenoh.keys import parse_token
from rclzenoh.session_config import environment_config

String = get_message("std_msgs/msg/String")
Int32 = get_message("std_msgs/msg/Int32")
Trigger = get_service("std_srvs/srv/Trigger")


def settle(*nodes):
    """Wait until each of some nodes knows all that they and their sessions have declared so far."""
    for node in nodes:
        # When the router has ended this unanswered query, it has also taken what the session declared before.
        list(node.context.session.get("nobody/has/this"))
    for node in nodes:
        node.context.graph.catch_up()


def test_the_graph_is_complete_when_a_node_begins(rig):
    session, domain = rig.context().session, int(os.environ["ROS_DOMAIN_ID"])
    tokens = [session.liveliness().declare_token(f"@ros2_lv/{domain}/1a/{i}/{i}/NN/%/%/n{i}") for i in range(500)]
    # When the router has ended this unanswered query, it has also taken the tokens.
    list(session.get("nobody/has/this"))
    assert len([name for name, _ in rig.node("observer").get_node_names_and_namespaces()]) == len(tokens) + 1


def test_endpoints_from_before_the_first_question_are_known_at_once(rig):
    asker, other = rig.node("asker"), rig.node("other")
    for node in (asker, other):
        node.create_publisher(String, "/t", 10)
    settle(other)
    assert asker.count_publishers("/t") == 2
    assert sorted(info.node_name for info in asker.get_publishers_info_by_topic("/t")) == ["asker", "other"]


def test_a_context_is_sent_only_what_it_has_asked_about(rig):
    counting, describing, other = rig.node("counting"), rig.node("describing"), rig.node("other")
    assert counting.count_subscribers("/t") == 0
    assert describing.get_publishers_info_by_topic("/t") == []
    settle(counting, describing, other)
    # Each node follows the nodes of its namespace, which are these three.
    assert [node.context.graph.changes for node in (counting, describing)] == [3, 3]
    other.create_service(Trigger, "/s", lambda _request, response: response)
    other.create_subscription(String, "/t", lambda _: None, 10)
    other.create_publisher(String, "/u", 10)
    other.create_publisher(String, "/t", 10)
    settle(other, counting, describing)
    assert counting.count_subscribers("/t") == len(describing.get_publishers_info_by_topic("/t")) == 1
    assert [node.context.graph.changes for node in (counting, describing)] == [4, 4]


def test_nodes_of_other_namespaces_are_not_sent_to_a_node_that_counts_in_its_own(rig):
    node, other = rig.node("a", namespace="/sim_0"), rig.node("a", namespace="/sim_1")
    assert node.count_subscribers("/sim_0/t") == node.count_subscribers("/t") == 0
    settle(node, other)
    before = node.context.graph.changes
    for name in ("/sim_1/t", "/sim_00/t", "/tt", "/sim_0/deep/u", "/sim_0/t"):
        other.create_subscription(String, name, lambda _: None, 10)
    another = rig.node("b", namespace="/sim_2")
    another.create_subscription(String, "/t", lambda _: None, 10)
    settle(other, another, node)
    assert node.count_subscribers("/sim_0/t") == node.count_subscribers("/t") == 1
    assert node.context.graph.changes == before + 3
    assert node.count_subscribers("/sim_0/deep/u") == 1
    assert len(node.get_node_names_and_namespaces()) == 3


def test_a_service_from_before_the_first_question_is_known_at_once(rig):
    node, other = rig.node("node"), rig.node("other")
    other.create_service(Trigger, "/s", lambda _request, response: response)
    settle(other)
    assert all(node.create_client(Trigger, "/s").service_is_ready() for _ in range(100))


def test_a_client_notices_its_service_and_no_other(rig):
    node, other = rig.node("node"), rig.node("other")
    client = node.create_client(Trigger, "/s")
    settle(node, other)
    before = node.context.graph.changes
    other.create_service(Trigger, "/other", lambda _request, response: response)
    service = other.create_service(Trigger, "/s", lambda _request, response: response)
    assert client.wait_for_service(30)
    # The client asks for the present state, and hears of the change in another thread.
    assert rig.spin(lambda: node.context.graph.changes > before)
    settle(other, node)
    assert node.context.graph.changes == before + 1
    other.destroy_service(service)
    assert rig.spin(lambda: not client.service_is_ready())


def test_a_context_that_asks_about_many_topics_is_sent_all(rig):
    asker, other = rig.node("asker"), rig.node("other")
    other.create_publisher(String, "/t99", 10)
    settle(asker, other)
    assert sum(len(asker.get_publishers_info_by_topic(f"/t{i}")) for i in range(100)) == 1
    before = asker.context.graph.changes
    other.create_publisher(String, "/u", 10)
    settle(other, asker)
    assert asker.context.graph.changes == before + 1


def test_endpoints_of_a_node_are_its_own_and_go_with_it(rig):
    asker, first, second = rig.node("asker"), rig.node("first"), rig.node("second")
    for node in (first, second):
        node.create_publisher(String, "/t", 10)
    kept = first.create_publisher(Int32, "/u", 10)
    first.create_subscription(String, "/s", lambda _: None, 10)

    def list_topics(node):
        found = asker.get_publisher_names_and_types_by_node(node, "/")
        return [(name, types) for name, types in found if name in ("/s", "/t", "/u")]

    of_both = ("/t", ["std_msgs/msg/String"])
    assert rig.spin(lambda: list_topics("first") == [of_both, ("/u", ["std_msgs/msg/Int32"])])
    assert rig.spin(lambda: list_topics("second") == [of_both])
    first.destroy_publisher(kept)
    assert rig.spin(lambda: list_topics("first") == [of_both])


def test_tokens_of_a_node_are_unique_and_carry_its_session(rig):
    node = rig.node("a")
    domain = node.context.get_domain_id()
    settle(node)
    with open_session(environment_config()) as session:
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
    odd.append("1a/0/0/MP/%/%/b/%t/type/hash/::,1:,:,:,,/of a later version")
    tokens = [other.session.liveliness().declare_token(f"@ros2_lv/{domain}/{key}") for key in odd]
    assert rig.spin(lambda: node.count_publishers("/t") == 1)
    assert [name for name, _ in node.get_node_names_and_namespaces()] == ["a"]
    tokens[-1].undeclare()
    assert rig.spin(lambda: node.count_publishers("/t") == 0)
    assert isinstance(tokens[0], zenoh.LivelinessToken)
