"""Episodes on their way through genuine rclpy: none may be dropped, however slow the coordinator is."""

import os
import subprocess
import sys

from tests.integration.robot import discovery_server
from throwcollect.ros.connection import Connection
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey

SMALL, LARGE, EVERY = 300, 4, 75
"""Episodes of 82 kB, at 100 a second; and of 5 MB, one after so many small ones."""
QOS = "ros.QoSProfile(history=ros.HistoryPolicy.KEEP_ALL)"

TALK = f"""
import time
from throwcollect import ros

ros.init()
node = ros.Node("simulation")
kind = ros.get_message("std_msgs/msg/UInt8MultiArray")
publisher = node.create_publisher(kind, "episode", {QOS})
while not publisher.get_subscription_count():
    time.sleep(0.01)
time.sleep(0.5)
begun, number = time.monotonic(), 0
for small in range({SMALL}):
    while time.monotonic() < begun + small / 100:
        time.sleep(0.001)
    for size in (82_000, 5_000_000) if small % {EVERY} == {EVERY - 1} else (82_000,):
        publisher.publish(kind(data=number.to_bytes(4, "little") + bytes([number % 251]) * size))
        number += 1
print("sent", number, flush=True)
input()
"""
LISTEN = f"""
import time
from throwcollect import ros

ros.init()
node = ros.Node("coordinator")
executor = ros.SingleThreadedExecutor()
executor.add_node(node)
heard = []

def hear(message):
    data = bytes(message.data)
    number = int.from_bytes(data[:4], "little")
    assert data[4:] == bytes([number % 251]) * (len(data) - 4)
    heard.append((number, len(data) > 5_000_000))
    time.sleep(0.015)

node.create_subscription(ros.get_message("std_msgs/msg/UInt8MultiArray"), "episode", hear, {QOS})
deadline = time.monotonic() + 40
while len(heard) < {SMALL + LARGE} and time.monotonic() < deadline:
    executor.spin_once(timeout_sec=0.1)
print([number for number, _ in heard] == list(range({SMALL + LARGE})), sum(large for _, large in heard), len(heard))
"""


def test_a_slow_subscriber_gets_every_episode(tmp_path):
    middleware = Middleware("rclpy", Middleware.of_process().rmw)
    with discovery_server() if middleware.is_fast_dds else router("tcp/127.0.0.1:0") as endpoint:
        joining = Connection(endpoint, RunKey(tmp_path), 0, middleware).environment()

        def start(program: str) -> subprocess.Popen[str]:
            return subprocess.Popen(
                [sys.executable, "-c", program],
                env={**os.environ, **joining},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )

        with start(LISTEN) as listener, start(TALK) as talker:
            said, _ = listener.communicate(timeout=60)
            sent, _ = talker.communicate("\n", timeout=60)
    # Zenoh prints to standard output when it is closed, so only the first line counts.
    assert sent.splitlines()[0] == f"sent {SMALL + LARGE}"
    assert said.splitlines()[0] == f"True {LARGE} {SMALL + LARGE}"
