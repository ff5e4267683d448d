"""Sessions whose links to the router are cut and restored: nothing that was sent to one node reaches another."""

import os
import time

from rclzenoh.interfaces import get_message, get_service
from rclzenoh.session_config import OVERRIDE_VARIABLE
from tests.contract.rig import start_python
from tests.cut_line import CutLine

GetParameters = get_service("rcl_interfaces/srv/GetParameters")
String = get_message("std_msgs/msg/String")

SESSIONS, PROCESSES, NODES = 40, 2, 3
CUTS = 5
BUSY_S = 0.4
"""Time [s] after a cut in which messages and requests are sent: in most of it, sessions are reconnecting."""

NODES_OF_SESSIONS = """
import sys

from rclzenoh.context import Context
from rclzenoh.executors import SingleThreadedExecutor
from rclzenoh.interfaces import get_message, get_service
from rclzenoh.node import Node


def offer(node):
    own = node.get_fully_qualified_name()

    def answer(request, response):
        if request.names != [own]:
            print("a request to", *request.names, "at", own, flush=True)
        return response

    def hear(message):
        if message.data != own:
            print("a message to", message.data, "at", own, flush=True)

    node.create_service(get_service("rcl_interfaces/srv/GetParameters"), "~/asked", answer)
    node.create_subscription(get_message("std_msgs/msg/String"), "~/heard", hear, 10)


first, end, nodes = map(int, sys.argv[1:])
contexts = [Context() for _ in range(first, end)]
executor = SingleThreadedExecutor(context=contexts[0])
for number, context in enumerate(contexts, first):
    context.init()
    for index in range(nodes):
        options = {"enable_rosout": False, "start_parameter_services": False}
        node = Node(f"node_{index}", namespace=f"sim_{number}", context=context, **options)
        offer(node)
        executor.add_node(node)
print("ready", flush=True)
executor.spin()
"""
"""Prints what reaches a node that is not its own."""


def test_nothing_reaches_another_node_while_links_to_the_router_are_cut_and_restored(rig, endpoint):
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    line = CutLine((host, 0), (host, int(port)))
    environment = {**os.environ, OVERRIDE_VARIABLE: f'connect/endpoints=["tcp/{host}:{line.address[1]}"]'}
    each = SESSIONS // PROCESSES
    processes = [
        start_python("-c", NODES_OF_SESSIONS, str(first), str(first + each), str(NODES), env=environment)
        for first in range(0, SESSIONS, each)
    ]
    try:
        assert [process.stdout.readline() for process in processes] == ["ready\n"] * PROCESSES
        node = rig.node("asking", enable_rosout=False, start_parameter_services=False)
        names = [f"/sim_{session}/node_{index}" for session in range(SESSIONS) for index in range(NODES)]
        publishers = [node.create_publisher(String, f"{name}/heard", 10) for name in names]
        clients = [node.create_client(GetParameters, f"{name}/asked") for name in names]
        messages = [String(data=name) for name in names]
        requests = [GetParameters.Request(names=[name]) for name in names]

        def ask():
            return [client.call_async(request) for client, request in zip(clients, requests, strict=True)]

        def most_answer():
            answers = ask()
            rig.rest(0.5)
            return sum(answer.done() for answer in answers) > len(names) / 2

        assert rig.spin(lambda: all(client.service_is_ready() for client in clients))
        answers = ask()
        assert rig.spin(lambda: all(answer.done() for answer in answers))
        for _ in range(CUTS):
            line.interrupt()
            busy_until = time.monotonic() + BUSY_S
            while time.monotonic() < busy_until:
                for publisher, message in zip(publishers, messages, strict=True):
                    publisher.publish(message)
                ask()
                rig.rest()
            assert rig.spin(lambda: all(client.service_is_ready() for client in clients))
        # Not all of them answer: a router of Zenoh 1.10 sometimes sends nothing more to a session that has reconnected.
        assert rig.spin(most_answer)
    finally:
        line.cut()
        for process in processes:
            process.terminate()
        strays = [stray for process in processes for stray in process.communicate(timeout=30)[0].splitlines()]
    assert strays == []
