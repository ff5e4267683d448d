"""The ROS graph, through a real router."""

import os

import zenoh

from rclzenoh.interfaces import get_message, get_service
from rclzenoh.keys import parse_token
from rclzenoh.session import open_session
from rclzenoh.session_config import environment_config

String = get_message("std_msgs/msg/String")
Int32 = get_message("std_msgs/msg/Int32")
Trigger = get_service("std_srvs/srv/Trigger")


def test_the_graph_is_complete_when_a_node_begins(rig):
    session, domain = rig.context().session, int(os.environ["ROS_DOMAIN_ID"])
    tokens = [session.liveliness().declare_token(f"@ros2_lv/{domain}/1a/{i}/{i}/NN/%/%/n{i}") for i in range(500)]
    # When the router has ended this unanswered query, it has also taken the tokens.
    list(session.get("nobody/has/this"))
    assert len([name for name, _ in rig.node("observer").get_node_names_and_namespaces()]) == len(tokens) + 1


def test_tokens_of_a_node_are_unique_and_carry_its_session(rig):
    node = rig.node("a")
    domain = node.context.get_domain_id()
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
    tokens = [other.session.liveliness().declare_token(f"@ros2_lv/{domain}/{key}") for key in odd]
    assert rig.spin(lambda: node.count_publishers("/t") == 1)
    assert [name for name, _ in node.get_node_names_and_namespaces()] == ["a"]
    tokens[-1].undeclare()
    assert rig.spin(lambda: node.count_publishers("/t") == 0)
    assert isinstance(tokens[0], zenoh.LivelinessToken)
