"""Nodes in processes of their own, and routers that come and go."""

import os
import signal
import subprocess
import time

from rclzenoh.interfaces import get_message
from rclzenoh.session_config import OVERRIDE_VARIABLE
from tests.contract.rig import SERVER, names_of, start_python

String = get_message("std_msgs/msg/String")


def test_nodes_survive_a_router_that_dies_and_comes_back(rig, monkeypatch):
    router = start_python("-m", "throwcollect", "router", "--listen", "tcp/127.0.0.1:0")
    endpoint = router.stdout.readline().split()[-1]
    monkeypatch.setenv(OVERRIDE_VARIABLE, f'connect/endpoints=["{endpoint}"]')
    talker, listener = rig.node("talker"), rig.node("listener")
    heard = []
    listener.create_subscription(String, "t", heard.append, 10)
    publisher = talker.create_publisher(String, "t", 10)
    assert rig.spin(lambda: publisher.get_subscription_count() == 1)
    router.kill()
    router.communicate()
    assert rig.spin(lambda: publisher.get_subscription_count() == 0)
    publisher.publish(String(data="lost"))
    router = start_python("-m", "throwcollect", "router", "--listen", endpoint)
    try:
        assert rig.spin(lambda: publisher.get_subscription_count() == 1)
        publisher.publish(String(data="back"))
        assert rig.spin(lambda: heard)
        assert heard[-1].data == "back"
        assert rig.spin(lambda: names_of(talker) == ["listener", "talker"])
    finally:
        os.kill(router.pid, signal.SIGTERM)
        router.communicate(timeout=60)


def test_a_call_that_waits_is_interrupted_by_sigint(environment):
    process = start_python("-c", SERVER, stderr=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors
