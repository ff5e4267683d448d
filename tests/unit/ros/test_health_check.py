import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress

import pytest

import throwcollect.ros.health_check as health
from rclzenoh.endpoint import unpack
from rclzenoh.interfaces import serialize
from rclzenoh.interfaces.srv import GetParameters
from rclzenoh.session_config import OVERRIDE_VARIABLE
from throwcollect.errors import ThrowcollectError
from throwcollect.ros.health_check import REQUEST, attachment, check, node_answers


@pytest.fixture
def spinning(rig):
    """Spins the nodes of the rig in a thread of their own while the test asks them."""
    ended = threading.Event()
    thread = threading.Thread(target=lambda: rig.spin(ended.is_set, timeout=60.0))
    yield thread.start
    ended.set()
    if thread.is_alive():
        thread.join()


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(health, "TIMEOUT_S", 0.3)


@pytest.mark.parametrize(("name", "namespace"), [("sim_3", "/sim_3"), ("sim_3", "/"), ("coordinator", "/")])
def test_a_health_check_of_a_working_node_passes(rig, spinning, name, namespace):
    rig.node(name, namespace=namespace)
    spinning()
    # The router may hear the question before it knows of the node: nothing orders two sessions.
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        with suppress(ThrowcollectError):
            check(name)
            break
    check(name)


def test_a_health_check_leaves_no_trace_in_the_graph_and_in_the_logs(rig, spinning, capfd):
    node = rig.node("sim_3", namespace="/sim_3")
    spinning()
    # From now on, every node, topic, service and client that appears is a change.
    node.get_node_names_and_namespaces()
    node.get_topic_names_and_types()
    node.get_service_names_and_types()
    node.get_client_names_and_types_by_node("sim_3", "/sim_3")
    changes = node.context.graph.changes
    check("sim_3")
    assert node.context.graph.changes == changes
    assert "ignored" not in capfd.readouterr().err


def test_a_health_check_of_a_stuck_node_fails(rig, impatient):
    rig.node("sim_3", namespace="/sim_3")
    with pytest.raises(ThrowcollectError, match="sim_3: does not answer") as caught:
        check("sim_3")
    assert caught.value.exit_code == 1
    assert "\n" not in str(caught.value)


def test_every_health_check_without_a_router_fails(environment, monkeypatch):
    monkeypatch.setenv(OVERRIDE_VARIABLE, 'connect/endpoints=["tcp/127.0.0.1:1"]')
    for node in ("router", "sim_3"):
        with pytest.raises(ThrowcollectError, match=f"{node}: no session with the router: .*tcp/127.0.0.1:1"):
            check(node)


def test_a_health_check_of_a_stuck_router_fails(environment, monkeypatch, impatient):
    command = [sys.executable, "-m", "throwcollect.ros.router", "--listen", "tcp/127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as router:
        try:
            endpoint = router.stdout.readline().split()[-1]
            monkeypatch.setenv(OVERRIDE_VARIABLE, f"connect/endpoints={json.dumps([endpoint])}")
            check("router")
            router.send_signal(signal.SIGSTOP)
            # The signal may take effect only after the call that sends it.
            os.waitpid(router.pid, os.WUNTRACED)
            with pytest.raises(ThrowcollectError, match="router: no session with the router"):
                check("router")
        finally:
            router.kill()


def test_the_health_request_equals_that_of_a_client_node():
    assert serialize(GetParameters.Request()) == REQUEST
    received = unpack(attachment())
    assert received.sequence == 1
    assert attachment() != attachment()


def test_a_node_that_nobody_spins_does_not_answer(rig):
    node = rig.node("stuck")
    session, domain = node.context.session, node.context.get_domain_id()
    assert not node_answers(session, "stuck", domain_id=domain, timeout_s=0.2)
