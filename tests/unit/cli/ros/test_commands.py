"""`throwcollect ros` beside a node that has one of everything."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from ruamel.yaml import YAML

from rclzenoh.interfaces import get_action, get_message
from rclzenoh.session_config import OVERRIDE_VARIABLE
from throwcollect.cli.main import main
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.own_process import stop_signals
from throwcollect.ros.connection import Connection
from throwcollect.ros.embedded import (
    ActionServer,
    CancelResponse,
    Context,
    DurabilityPolicy,
    Future,
    GoalResponse,
    IntegerRange,
    Node,
    ParameterDescriptor,
    QoSProfile,
    SingleThreadedExecutor,
)
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey

String: Any = get_message("std_msgs/msg/String")
JointState: Any = get_message("sensor_msgs/msg/JointState")
FJT: Any = get_action("control_msgs/action/FollowJointTrajectory")
FOLLOW = "/robot/follow"


class Robot(Node):
    """Has a latched topic, a topic that ticks, an action and parameters."""

    def __init__(self, context: Context) -> None:
        super().__init__("driver", namespace="/robot", context=context)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.description = self.create_publisher(String, "description", latched)
        self.description.publish(String(data="x" * 200))
        self.states = self.create_publisher(JointState, "states", 10)
        self.create_timer(0.02, lambda: self.states.publish(JointState(name=["a"], position=[1.5])))
        self.declare_parameter("limit", 3, ParameterDescriptor(integer_range=[IntegerRange(from_value=0, to_value=9)]))
        self.declare_parameter("names", ["a", "b"])
        ActionServer(self, FJT, "follow", self.execute, goal_callback=self.consider, cancel_callback=self.cancel)
        self.ends = Future()

    def consider(self, goal: Any) -> GoalResponse:
        self.ends = Future()
        if "late" in goal.trajectory.joint_names:
            time.sleep(0.5)
        return GoalResponse.ACCEPT if goal.trajectory.joint_names else GoalResponse.REJECT

    def cancel(self, _handle: Any) -> CancelResponse:
        self.ends.set_result("canceled")
        return CancelResponse.ACCEPT

    async def execute(self, handle: Any) -> Any:
        handle.publish_feedback(FJT.Feedback(joint_names=["moving"]))
        how = handle.request.trajectory.joint_names[0]
        if how == "wait":
            how = await self.ends
        getattr(handle, how)()
        return FJT.Result(error_string=f"it {how}")


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """A router with the robot behind it, which spins in a thread."""
    with router("tcp/127.0.0.1:0") as endpoint, pytest.MonkeyPatch.context() as patch:
        patch.setenv(OVERRIDE_VARIABLE, f"connect/endpoints={json.dumps([endpoint])}")
        patch.delenv("ZENOH_SESSION_CONFIG_URI", raising=False)
        patch.setenv("ROS_DOMAIN_ID", "0")
        context = Context()
        context.init()
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(Robot(context))

        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield endpoint
        executor.shutdown()
        thread.join()
        context.try_shutdown()


class Said(NamedTuple):
    code: object
    out: str
    err: str


@pytest.fixture
def say(endpoint: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    def run(*arguments: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["throwcollect", "ros", *arguments])
        before = [(number, signal.getsignal(number)) for number in stop_signals()]
        try:
            main()
        except SystemExit as end:
            return Said(end.code, *capsys.readouterr())
        finally:
            for number, handler in before:
                signal.signal(number, handler)
        raise AssertionError("the command did not exit")

    return run


def start(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "throwcollect", "ros", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )


def test_the_list_of_topics_leaves_out_hidden_names(say: Callable[..., Said]) -> None:
    topics = say("topic", "list", "-t").out.splitlines()
    assert "/robot/states [sensor_msgs/msg/JointState]" in topics
    assert not any("_action" in topic for topic in topics)


def test_topic_echo_prints_a_message_or_one_of_its_fields_as_yaml(say: Callable[..., Said]) -> None:
    text = say("topic", "echo", "/robot/states", "--once").out.removesuffix("---\n")
    assert YAML(typ="safe").load(text) == {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "name": ["a"],
        "position": [1.5],
        "velocity": [],
        "effort": [],
    }
    assert list(YAML(typ="safe").load(text)) == ["header", "name", "position", "velocity", "effort"]
    assert say("topic", "echo", "/robot/states", "--once", "--field", "header.stamp").out == "sec: 0\nnanosec: 0\n---\n"
    # A latched message arrives, too.
    assert say("topic", "echo", "/robot/description", "--once", "--field", "data").out == f"{'x' * 200}\n---\n"
    assert say("topic", "echo", "/robot/states", "--once", "--field", "position").out == "- 1.5\n---\n"


def test_parameters_are_read_and_set(say: Callable[..., Said]) -> None:
    assert say("param", "get", "robot/driver", "names").out == "- a\n- b\n"
    assert say("param", "set", "/robot/driver", "names", "[c]") == (0, "Set parameter successful\n", "")
    assert say("param", "get", "/robot/driver", "names").out == "- c\n"
    say("param", "set", "/robot/driver", "names", "[a, b]")
    refused = say("param", "set", "/robot/driver", "limit", "10")
    assert refused.code == 2
    assert refused.err.startswith("throwcollect: setting limit of /robot/driver failed: Parameter limit out of range")
    assert say("param", "set", "/robot/driver", "limit", "-1").err.endswith("value: -1\n"), "a number, and no option"


def test_action_send_prints_feedback_and_result_of_a_goal(say: Callable[..., Said]) -> None:
    goal = "{trajectory: {joint_names: [succeed], points: [{positions: [1, 2], time_from_start: {sec: 1}}]}}"
    said = say("action", "send", FOLLOW, FJT.TYPE, goal, "-f")
    assert said.code == 0, said.err
    assert "        - 1.0\n" in said.out
    assert "Feedback:\n    header:\n" in said.out
    assert "error_string: it succeed\n" in said.out
    assert said.out.endswith("Goal finished with status: SUCCEEDED\n")


def test_an_aborted_goal_ends_with_exit_code_1_and_a_rejected_goal_with_2(say: Callable[..., Said]) -> None:
    said = say("action", "send", FOLLOW, FJT.TYPE, "{trajectory: {joint_names: [abort]}}")
    assert (said.code, said.err) == (1, f"throwcollect: {FOLLOW}: the goal was not reached: ABORTED\n")
    said = say("action", "send", FOLLOW, FJT.TYPE, "{}")
    assert said.code == 2
    assert f"{FOLLOW}: the goal was rejected" in said.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("topic echo /robot/state", "no topic /robot/state; did you mean '/robot/states'?"),
        (f"action send {FOLLOW} {FJT.TYPE} {{trajectory:\\ 1}}", "trajectory: should be fields with values, got 1"),
        ("param set /robot/driver limits 1", "parameter 'limits' is not declared"),
    ],
)
def test_a_wrong_argument_gives_one_clear_message_and_exit_code_2(
    arguments: str, message: str, say: Callable[..., Said], monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    monkeypatch.setenv("THROWCOLLECT_STATE", str(tmp_path))
    words = [word.replace("\0", " ") for word in arguments.replace("\\ ", "\0").split(" ")]
    said = say(*words)
    assert (said.code, said.out) == (2, "")
    assert message in said.err
    # The robot logs to the same stream, so its lines may come before the message of the command.
    assert "\nthrowcollect: " in f"\n{said.err}"
    assert "internal error" not in said.err


def write_record(run: Run, directory: Path, endpoint: str, **fields: Any) -> None:
    record = run.begin("throws", directory / "data", runtime="local", endpoint=endpoint)
    run.write(replace(record, **{"logs": directory, "simulations": 1, **fields}))


def test_commands_join_a_run_by_its_name_or_directory(
    endpoint: str, say: Callable[..., Said], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("THROWCOLLECT_STATE", str(tmp_path))
    for variable in Connection(endpoint, RunKey(tmp_path)).environment():
        monkeypatch.setenv(variable, "nonsense")
    run = Records().new("throws")
    write_record(run, tmp_path, endpoint)
    override = f'mode="client";connect/endpoints=["{endpoint}"];listen/endpoints=[]'
    line = (
        f"export THROWCOLLECT_ROS=embedded ZENOH_CONFIG_OVERRIDE='{override}' ROS_DOMAIN_ID=0 "
        f"THROWCOLLECT_KEY={run.key.directory} RMW_IMPLEMENTATION=rmw_zenoh_cpp\n"
    )
    assert say("env") == (0, line, "")
    for named in (run.id, "thr", str(tmp_path / "data")):
        assert "/robot/states" in say("topic", "list", "--run", named).out.splitlines()
        assert say("env", "--run", named) == (0, line, "")
    rejected = say("action", "send", FOLLOW, FJT.TYPE, "{}", "--run", run.id)
    assert f"the log of the node has the reason: throwcollect ros topic echo /rosout --run {run.id}\n" in rejected.err
    run.update(endpoint=None)
    for command in (("topic", "list"), ("env",)):
        assert say(*command, "--run", run.id).code == 3
    run.close()
    assert "its launcher died" in say("topic", "list", "--run", run.id).err


def test_env_for_a_run_on_fast_dds_writes_a_profile_that_only_its_owner_can_read(
    say: Callable[..., Said], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("THROWCOLLECT_STATE", str(tmp_path))
    run = Records().new("throws")
    run.key.create()
    write_record(run, tmp_path, "udp/127.0.0.1:9", domain_id=5, middleware=Middleware("rclpy", "rmw_fastrtps_cpp"))
    for _ in range(2):
        said = say("env")
        assert (said.code, said.err) == (0, "")
    script = f"{said.out}\nprintenv THROWCOLLECT_ROS RMW_IMPLEMENTATION ROS_DOMAIN_ID ROS_AUTOMATIC_DISCOVERY_RANGE"
    script += "\nprintenv FASTRTPS_DEFAULT_PROFILES_FILE"
    told = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=True).stdout.splitlines()
    assert told[:4] == ["rclpy", "rmw_fastrtps_cpp", "5", "SYSTEM_DEFAULT"]
    profile = Path(told[4])
    assert profile.parent == run.key.directory.parent
    assert profile.stat().st_mode & 0o777 == 0o600
    assert "<udpv4><address>127.0.0.1</address><port>9</port></udpv4>" in profile.read_text(encoding="utf-8")
    assert run.key.private_key.read_text().splitlines()[1] not in said.out + profile.read_text(encoding="utf-8")
    run.close()


def test_topic_hz_prints_the_rate_of_a_topic_until_ctrl_c(endpoint: str) -> None:
    process = start("topic", "hz", "/robot/states")
    assert process.stdout is not None
    words = (process.stdout.readline() + process.stdout.readline()).split()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert words[:2] == ["average", "rate:"]
    assert 0 < float(words[2]) < 60
    assert process.returncode == 130


@pytest.mark.parametrize(("joints", "line"), [("wait", "Goal accepted"), ("wait, late", "Sending goal")])
def test_ctrl_c_cancels_the_goal_of_action_send(endpoint: str, joints: str, line: str) -> None:
    process = start("action", "send", FOLLOW, FJT.TYPE, f"{{trajectory: {{joint_names: [{joints}]}}}}")
    assert process.stdout is not None
    while not process.stdout.readline().startswith(line):
        assert process.poll() is None
    # This is time enough to send the goal; a "late" goal is accepted only after the signal.
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "")
    assert "Canceling goal...\nGoal canceled.\n" in out
