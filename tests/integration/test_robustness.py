"""A simulation among hostile, clumsy and dying neighbours: it goes on, and answers whoever asks correctly."""

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import zenoh

from rclzenoh.endpoint import Attachment
from rclzenoh.interfaces import deserialize, message_class, serialize
from rclzenoh.keys import EntityKind, Token, data_key
from tests.commands import Command
from tests.integration.robot import ARM, OWN, PLAYING, Robot, environment, goal, swing
from tests.integration.test_leases import lease, wait_for_episodes
from throwcollect.ros import get_message
from throwcollect.ros.middleware import uses_rclpy

# These tests do not cover how rclpy and its RMW handle garbage.
embedded_alone = pytest.mark.skipif(
    uses_rclpy() or os.environ.get("SIMULATION_ROS") == "rclpy", reason="somebody is on genuine rclpy"
)

SEED = 20
PAYLOADS = 4
"""Number of malformed payloads for each key, and of malformed attachments and changed messages."""
AT_ONCE = 5
"""Fewer requests than a queue holds, as a full queue refuses further ones unread."""
VALID = Attachment(1, 0, bytes(16)).pack()
CONSEQUENTIAL = ("set_simulation_state", "step_simulation", "simulate_steps")
"""Services and actions whose valid requests may end the process or keep it busy for long."""


CLIENT = """
import sys
from throwcollect import ros
from throwcollect.ros import get_action
from tests.integration.robot import swing

ros.init()
node = ros.Node("vanishing")
kind = get_action("control_msgs/action/FollowJointTrajectory")
client = ros.ActionClient(node, kind, sys.argv[1])
assert client.wait_for_server(30)
sent = client.send_goal_async(swing(float(sys.argv[2])))
executor = ros.SingleThreadedExecutor()
executor.add_node(node)
executor.spin_until_future_complete(sent)
sent.result().get_result_async()
print("accepted", sent.result().accepted, flush=True)
executor.spin()
"""


def endpoints(robot: Robot, kind: EntityKind) -> list[Token]:
    """Everything of one kind that the nodes of the simulation have."""
    if uses_rclpy():
        pytest.skip("rclpy does not show the tokens")
    namespace = f"/{robot.name}"
    tokens = robot.node.context.graph.tokens(kind)
    return [
        token
        for token in tokens
        if token.node_namespace == namespace or token.node_namespace.startswith(f"{namespace}/")
    ]


def mutate(data: bytes, chance: random.Random) -> bytes:
    """A message with some octets changed, inserted or left out."""
    out = bytearray(data)
    for _ in range(chance.randint(1, 8)):
        where = chance.randrange(len(out))
        what = chance.choice(("change", "insert", "cut"))
        if what == "change":
            out[where] = chance.choice((0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)))
        elif what == "insert":
            out[where:where] = chance.randbytes(chance.randint(1, 9))
        elif len(out) > 5:
            del out[max(where, 1) :]
    return bytes(out) or b"\0"


def is_correct(data: bytes, type_name: str) -> bool:
    try:
        deserialize(data, message_class(type_name))
    except ValueError:
        return False
    return True


def hostile(type_name: str, sample: Any, chance: random.Random) -> Iterator[tuple[bytes, bytes | None]]:
    """Payloads with attachments, of which at least one is odd."""
    good = serialize(sample)
    for _ in range(PAYLOADS):
        body = chance.randbytes(chance.randint(0, 200))
        yield body, VALID
        yield b"\0\1\0\0" + body, VALID
        yield good, chance.choice((None, b"", chance.randbytes(chance.randint(0, 60)), VALID[:-1], VALID + b"x"))
        yield mutate(good, chance), VALID


@embedded_alone
def test_a_simulation_survives_garbage_on_every_key(running: tuple[Command, Robot]) -> None:
    process, robot = running
    chance = random.Random(SEED)
    session, domain = robot.node.context.session, robot.node.context.get_domain_id()
    services, topics = endpoints(robot, EntityKind.SERVICE), endpoints(robot, EntityKind.SUBSCRIPTION)
    assert {token.name for token in topics} >= {f"/{OWN}/{ARM}/joint_trajectory"}
    assert {token.name for token in services} >= {
        f"/{OWN}/{ARM}/follow_joint_trajectory/_action/{part}" for part in ("send_goal", "cancel_goal", "get_result")
    }
    for token in topics:
        key = data_key(domain, token.name, token.topic_type, token.topic_type_hash)
        for number, (payload, attachment) in enumerate(hostile(token.topic_type, sample_of(token.topic_type), chance)):
            session.put(key, payload, attachment=attachment)
            if number % AT_ONCE == 0:
                robot.state()
        # Some mutated trajectories are valid and would last for years.
        robot.reset()
    unanswered: set[int] = set()
    for token in services:
        key = data_key(domain, token.name, token.topic_type, token.topic_type_hash)
        request = f"{token.topic_type}_Request"
        for payload, attachment in hostile(request, sample_of(request), chance):
            if any(part in token.name for part in CONSEQUENTIAL) and is_correct(payload, request):
                continue
            ask(session, key, payload, attachment, unanswered)
            robot.wait_until(lambda: len(unanswered) < AT_ONCE, f"{token.name} answers, or says that it does not")
        robot.reset()
    robot.wait_until(lambda: not unanswered, "everything is answered")
    assert process.poll() is None, process.communicate()
    assert_works(robot)


def sample_of(type_name: str) -> Any:
    """A message that is worth changing."""
    if type_name.endswith("FollowJointTrajectory_SendGoal_Request"):
        message = message_class(type_name)()
        message.goal = goal(ARM)
        return message
    if type_name == "trajectory_msgs/msg/JointTrajectory":
        return goal(ARM).trajectory
    message = message_class(type_name)()
    for field in message.FIELDS:
        if field.sequence and field.type == "string":
            setattr(message, field.name, ["ball.mass_kg", "use_sim_time"])
        elif field.sequence and field.type == "rcl_interfaces/msg/Parameter":
            setattr(message, field.name, [message_class(field.type)(name="sim.real_time_factor")])
    return message


_asked = 0


def ask(session: Any, key: str, payload: bytes, attachment: bytes | None, unanswered: set[int]) -> None:
    """Send a request; its number is taken from the set once no more answers come."""
    global _asked
    _asked += 1
    number = _asked
    unanswered.add(number)
    handler = zenoh.handlers.Callback(lambda _: None, drop=lambda: unanswered.discard(number), indirect=False)
    session.get(
        key, handler, payload=payload, attachment=attachment, target=zenoh.QueryTarget.ALL_COMPLETE, timeout=10.0
    )


def assert_works(robot: Robot) -> None:
    """A motion as a client has it, from the parameters to the result."""
    assert robot.set({"sim.real_time_factor": 0.0}).successful
    if robot.state() != PLAYING:
        robot.put_into(PLAYING)
    robot.reset()
    handle = robot.send(swing(0.3))
    assert handle.accepted
    assert robot.outcome(handle)[1] == 0


def test_a_goal_goes_on_when_its_client_vanishes_and_is_forgotten_in_time(
    running: tuple[Command, Robot], endpoint: str
) -> None:
    process, robot = running
    action = robot.topic(f"{ARM}/follow_joint_trajectory")
    assert robot.set({"sim.real_time_factor": 1.0}).successful
    command = [sys.executable, "-c", CLIENT, action, "1.5"]
    client = subprocess.Popen(command, env={**os.environ, **environment(endpoint)}, stdout=subprocess.PIPE, text=True)
    assert client.stdout is not None
    assert client.stdout.readline() == "accepted True\n"
    client.send_signal(signal.SIGKILL)
    client.communicate()
    statuses: list[Any] = []
    robot.node.create_subscription(
        get_message("action_msgs/msg/GoalStatusArray"), f"{action}/_action/status", statuses.append, 10
    )

    def last() -> list[int]:
        return [each.status for each in statuses[-1].status_list] if statuses else []

    robot.wait_until(lambda: last() == [4], "the goal of nobody is reached")
    assert robot.set({"sim.real_time_factor": 0.0}).successful
    # The clock of the simulation jumps by more than the time for which results are kept.
    wait_for_episodes(robot, lease(robot, {}, trial=3))
    assert robot.outcome(robot.send(goal(ARM, 2.0)))[1] == 0
    # On DDS, the result may overtake the status.
    robot.wait_until(lambda: last() == [4], "the status of the new goal alone")
    assert process.poll() is None
