"""Nodes in processes of their own."""

import subprocess
import sys

from tests.contract.rig import ON_RCLPY, names_of

GONE_S = 40.0 if ON_RCLPY else 5.0
"""By itself, DDS believes for 20 s in a process that says nothing any more."""

SERVER = """
from throwcollect import ros

ros.init()
node = ros.Node("server")

def answer(request, response):
    response.success = True
    return response

node.create_service(ros.get_service("std_srvs/srv/Trigger"), "trigger", answer)
executor = ros.SingleThreadedExecutor()
executor.add_node(node)
print("ready", flush=True)
try:
    executor.spin()
except ros.ExternalShutdownException:
    pass
print("asked to end", flush=True)
{end}
"""


def start(*arguments, **options):
    return subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True, **options)


def test_a_process_that_forgets_to_shut_down_ends(environment):
    script = "from throwcollect import ros; ros.init(); ros.Node('n')"
    assert subprocess.run([sys.executable, "-c", script], timeout=20, check=False).returncode == 0


def test_a_killed_node_leaves_the_graph(rig):
    process = start("-c", SERVER.format(end=""))
    process.stdout.readline()
    node = rig.node("observer")
    assert rig.sees(lambda: names_of(node) == ["observer", "server"])
    process.kill()
    process.communicate()
    assert rig.spin(lambda: names_of(node) == ["observer"], timeout=GONE_S)
