"""A simulation among hostile, clumsy and dying neighbours: it goes on, and answers whoever asks correctly."""

import os
import random
import signal
import string
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from rclzenoh.endpoint import Attachment
from rclzenoh.interfaces import deserialize, message_class, serialize
from rclzenoh.keys import EntityKind, Token, data_key
from tests.commands import Command
from tests.integration.robot import ARM, OWN, PLAYING, Robot, connect, environment, goal, start_simulation, swing
from throwcollect.ros import DurabilityPolicy, QoSProfile, get_message
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

LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

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
    return [token for token in tokens if token.namespace == namespace or token.namespace.startswith(f"{namespace}/")]


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
        key = data_key(domain, token.name, token.ros_type, token.type_hash)
        for number, (payload, attachment) in enumerate(hostile(token.ros_type, sample_of(token.ros_type), chance)):
            session.put(key, payload, attachment=attachment)
            if number % AT_ONCE == 0:
                robot.state()
        # Some mutated trajectories are valid and would last for years.
        robot.reset()
    unanswered: set[int] = set()
    for token in services:
        key, request = data_key(domain, token.name, token.ros_type, token.type_hash), f"{token.ros_type}_Request"
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
    """A trial as a coordinator has it, from the parameters to the result."""
    assert robot.set({"sim.real_time_factor": 0.0, "trial.controllers": [""]}).successful
    if robot.state() != PLAYING:
        robot.put_into(PLAYING)
    robot.reset()
    handle = robot.send(swing(0.3))
    assert handle.accepted
    assert robot.outcome(handle)[1] == 0


@embedded_alone
def test_a_simulation_survives_malformed_tokens(running: tuple[Command, Robot], endpoint: str) -> None:
    process, robot = running
    chance = random.Random(SEED)
    session, domain = robot.node.context.session, robot.node.context.get_domain_id()
    letters = string.ascii_letters + string.digits + "%_:,.-~@é\N{GRINNING FACE}"
    tokens = []
    for index in range(300):
        chunks = ["1a", str(index), str(index), "MS", "%", f"%{OWN}", "odd", f"%{OWN}%joint_states"]
        chunks += ["sensor_msgs::msg::dds_::JointState_", "RIHS01_0", "::,1:,:,:,,"]
        for _ in range(chance.randint(1, 4)):
            where = chance.randrange(len(chunks))
            chunks[where] = "".join(chance.choices(letters, k=chance.choice((1, 3, 20, 5000))))
        if chance.random() < 0.3:
            del chunks[chance.randrange(len(chunks)) :]
        key = "/".join(["@ros2_lv", str(domain), *chunks]).removesuffix("/")
        try:
            tokens.append(session.liveliness().declare_token(key))
        except zenoh.ZError:
            continue  # Zenoh itself refuses this key.
    assert len(tokens) > 200
    assert_works(robot)
    for token in tokens:
        token.undeclare()
    assert_works(robot)
    assert process.poll() is None


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
    assert robot.set({"sim.real_time_factor": 0.0, "trial.number": 3}).successful
    # The clock of the simulation jumps by more than the time for which results are kept.
    robot.reset()
    assert robot.outcome(robot.send(swing(0.2)))[1] == 0
    # On DDS, the result may overtake the status.
    robot.wait_until(lambda: last() == [4], "the status of the new goal alone")
    assert process.poll() is None


def test_a_clock_that_jumps_back_keeps_results_and_later_goals(robot: Robot) -> None:
    assert robot.set({"trial.number": 9}).successful
    robot.reset()
    late = robot.send(swing(0.2))
    assert robot.outcome(late)[1] == 0
    assert robot.set({"trial.number": 0}).successful
    robot.reset()
    assert robot.outcome(late)[1] == 0
    early = robot.send(swing(0.2))
    assert robot.outcome(early)[1] == 0
    assert robot.outcome(late)[1] == 0


def start_router(listen: str) -> tuple[subprocess.Popen[str], str]:
    process = subprocess.Popen(
        [sys.executable, "-m", "throwcollect.ros.router", "--listen", listen], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    return process, process.stdout.readline().split()[-1]


def test_a_simulation_survives_the_loss_of_its_router_and_reconnects(tmp_path: Path) -> None:
    router, endpoint = start_router("tcp/127.0.0.1:0")
    simulation = start_simulation(tmp_path, endpoint, OWN)
    try:
        with connect(endpoint) as context:
            robot = Robot(context, OWN)
            robot.wait_until_ready(simulation)
            # A simulation checks itself by a client before it is ready; the test waits until that client has gone.
            robot.wait_until(lambda: not endpoints(robot, EntityKind.CLIENT), "it has asked itself")
            before = {token.key() for kind in EntityKind for token in endpoints(robot, kind)}
            assert robot.set({"sim.real_time_factor": 1.0}).successful
            handle = robot.send(swing(1.0))
            lost = handle.get_result_async()
            router.kill()
            router.communicate()
            robot.wait_until(lambda: not endpoints(robot, EntityKind.NODE), "it is out of sight")
            router, _ = start_router(endpoint)

            def list_keys() -> set[str]:
                return {token.key() for kind in EntityKind for token in endpoints(robot, kind)}

            robot.wait_until(lambda: list_keys() == before, "everything is announced again")
            # The request for the result was lost with the router, but the result itself was not.
            assert robot.outcome(handle)[:2] == (4, 0)
            assert not lost.done()
            with robot.listening("std_msgs/msg/String", "robot_description", LATE) as heard:
                robot.wait_until(lambda: bool(heard), "what was published before")
            assert_works(robot)
    finally:
        for process in (router, simulation):
            process.kill()
            process.communicate()


@embedded_alone
def test_two_simulations_of_one_name_both_work(running: tuple[Command, Robot], endpoint: str, tmp_path: Path) -> None:
    process, robot = running
    (tmp_path / "twin").mkdir()
    twin = start_simulation(tmp_path / "twin", endpoint, OWN)
    try:
        robot.wait_until(lambda: robot.node.count_publishers(robot.topic("episode")) == 2, "the twin is ready")
        tf = robot.topic("tf")
        # Identifiers may begin alike, so whole ones are compared.
        robot.wait_until(
            lambda: len({bytes(each.endpoint_gid) for each in robot.node.get_publishers_info_by_topic(tf)}) == 2,
            "both have a publisher with an identifier of its own",
        )
        with robot.listening("sensor_msgs/msg/JointState", "joint_states") as heard:
            assert robot.set({"trial.number": 1}).successful
            robot.reset()
            assert robot.outcome(robot.send(swing(0.2)))[1] == 0
            robot.wait_until(lambda: len(heard) > 50, "samples")
        assert process.poll() is None
        assert twin.poll() is None
    finally:
        twin.kill()
        output, _ = twin.communicate()
    assert f"there is another node /{OWN}/{OWN}" in output
    assert_works(robot)
