"""A node checks whether other nodes can reach it."""

import pytest

from throwcollect.errors import WorkerError
from throwcollect.ros import SingleThreadedExecutor, self_check
from throwcollect.ros.self_check import check_answers


def test_a_node_that_is_spun_answers_itself(rig):
    node = rig.node("node")
    check_answers(node, node.executor)
    assert rig.spin(lambda: node.get_client_names_and_types_by_node("node", "/") == [])


def test_a_node_that_nobody_spins_fails_its_self_check(rig, monkeypatch):
    monkeypatch.setattr(self_check, "_ANSWER_S", 0.5)
    node = rig.node("node")
    with pytest.raises(WorkerError, match=r"/node does not answer itself within 0.5 s, over (the embedded|rclpy with)"):
        check_answers(node, SingleThreadedExecutor(context=node.context))
