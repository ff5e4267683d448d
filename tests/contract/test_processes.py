"""Nodes in processes of their own."""

import subprocess
import sys

from tests.contract.rig import ON_RCLPY, SERVER, names_of, start_python

GONE_S = 40.0 if ON_RCLPY else 30.0
"""By default, DDS takes a silent process for living for 20 s."""


def test_a_process_that_forgets_to_shut_down_ends(environment):
    script = "from throwcollect import ros; ros.init(); ros.Node('n')"
    assert subprocess.run([sys.executable, "-c", script], timeout=20, check=False).returncode == 0


def test_a_killed_node_leaves_the_graph(rig):
    process = start_python("-c", SERVER)
    try:
        process.stdout.readline()
        node = rig.node("observer")
        assert rig.sees(lambda: names_of(node) == ["observer", "server"])
    finally:
        # One that is left behind would be seen when this test runs again.
        process.kill()
        process.communicate()
    assert rig.spin(lambda: names_of(node) == ["observer"], timeout=GONE_S)
