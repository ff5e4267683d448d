"""Names, log messages and the end of a node."""

import re
from pathlib import Path

import pytest

from tests.contract.rig import NotInitializedException, choose_words, exceptions, get_logger
from throwcollect.ros import Context, DurabilityPolicy, Node, QoSProfile, get_message

Log = get_message("rcl_interfaces/msg/Log")


def test_a_node_needs_an_initialised_context_and_a_valid_name(rig):
    with pytest.raises(NotInitializedException, match="cannot create node"):
        Node("a", context=Context())
    with pytest.raises(exceptions.NameValidationException, match=r"(?i)invalid node name"):
        rig.node("a/b")


def test_a_node_knows_its_names(rig):
    node = rig.node("sim", namespace="talos")
    assert (node.get_name(), node.get_namespace()) == ("sim", "/talos")
    assert node.get_fully_qualified_name() == "/talos/sim"
    assert node.resolve_topic_name("~/x") == "/talos/sim/x"


def test_log_messages_go_to_standard_error_and_rosout(rig, capfd):
    node, heard = rig.node("sim", namespace="talos"), []
    node.get_logger().warning("careful")
    qos = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    rig.node("console").create_subscription(Log, "/rosout", heard.append, qos)
    assert rig.spin(lambda: heard)
    assert (heard[0].name, heard[0].level, heard[0].msg) == (
        "talos.sim",
        Log.WARN[0] if isinstance(Log.WARN, bytes) else Log.WARN,
        "careful",
    )
    assert (heard[0].file, heard[0].function) == (__file__, "test_log_messages_go_to_standard_error_and_rosout")
    assert "careful" in Path(__file__).read_text(encoding="utf-8").splitlines()[heard[0].line - 1]
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("[WARN] [")
    assert lines[0].endswith("[talos.sim]: careful")


# rclpy warns only of nodes in the same process, because they share a logger.
WARNING = choose_words(embedded="there is another node /ns/twin", rclpy="node name: 'twin'.*'ns.twin'")


@pytest.mark.parametrize("same_session", [True, False])
def test_a_second_node_of_the_same_name_works_and_logs_a_warning(rig, capfd, same_session):
    first = rig.node("twin", namespace="ns")
    rig.node("twin", namespace="other")
    assert "twin" not in capfd.readouterr().err
    second = rig.node("twin", namespace="ns", context=first.context if same_session else None)
    assert re.search(WARNING, capfd.readouterr().err)
    heard = []
    for node in (first, second):
        node.create_subscription(Log, "t", lambda _, node=node: heard.append(node), 10)
    publisher = rig.node("talker").create_publisher(Log, "/ns/t", 10)
    assert rig.spin(lambda: publisher.get_subscription_count() == 2)
    publisher.publish(Log())
    assert rig.spin(lambda: set(map(id, heard)) == {id(first), id(second)})


def test_logging_goes_on_after_the_node_ended(rig, capfd):
    node = rig.node("sim")
    node.destroy_node()
    node.get_logger().info("late")
    assert "late" in capfd.readouterr().err


def test_a_throttled_log_message_is_printed_once(capfd):
    logger = get_logger("limited")
    assert [logger.info("slow", throttle_duration_sec=100.0) for _ in range(3)] == [True, False, False]
    assert capfd.readouterr().err.count("\n") == 1


def test_destroying_a_node_twice_or_after_shutdown_is_harmless(rig):
    first, second = rig.node("a"), rig.node("b")
    first.destroy_node()
    first.destroy_node()
    second.context.shutdown()
    second.destroy_node()
