"""One simulation in a process of its own, and a client of it that knows nothing but its ROS interface."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rclzenoh.interfaces import Message
from rclzenoh.session_config import CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE
from tests.commands import Command, command, start_command
from throwcollect.config.schema import Config
from throwcollect.robots.description import robot_of, start_posture
from throwcollect.ros import (
    ActionClient,
    Context,
    Future,
    HistoryPolicy,
    Node,
    Parameter,
    QoSProfile,
    SingleThreadedExecutor,
    get_action,
    get_message,
    get_service,
    init,
)
from throwcollect.ros.middleware import VARIABLE, Middleware, uses_rclpy
from throwcollect.run_key import Signer

CONFIG = Config.model_validate({"name": "integration", "tool": {"cup_floor_radius_m": 0.006}})
"""Defaults, but for a spoon through which the smallest balls fall."""
OWN = "sim_1"
"""Name of a simulation that a test has for itself."""
POSTURE = start_posture(CONFIG)
ARM, TORSO, HEAD = "arm_right_controller", "torso_controller", "head_controller"
ELBOW = "arm_right_4_joint"
STEP_NS = 10**9 // CONFIG.sim.physics_hz
SAMPLE_NS = 10**9 // CONFIG.record.rate_hz
ON_DDS = Middleware.of_process().is_fast_dds
PATIENCE_S = 20.0 if ON_DDS else 60.0
"""On Fast DDS, nodes that have not found each other in 20 s never do, and `tests/ros` starts the tests again."""
FOUND_BY_OTHERS_S = 0.3

ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)
"""With this profile, the client loses no message, however late it looks."""

in_order_of_arrival = pytest.mark.skipif(
    uses_rclpy(), reason="rclpy takes up a topic's messages and answers as it likes"
)

FollowJointTrajectory: Any = get_action("control_msgs/action/FollowJointTrajectory")
JointTrajectory: Any = get_message("trajectory_msgs/msg/JointTrajectory")
JointTrajectoryPoint: Any = get_message("trajectory_msgs/msg/JointTrajectoryPoint")
JointTolerance: Any = get_message("control_msgs/msg/JointTolerance")
Duration: Any = get_message("builtin_interfaces/msg/Duration")
Result: Any = get_message("simulation_interfaces/msg/Result")
SimulationState: Any = get_message("simulation_interfaces/msg/SimulationState")
STOPPED, PLAYING, PAUSED, QUITTING = range(4)


def environment(endpoint: str) -> dict[str, str]:
    """Variables that lead a node to a router."""
    return {OVERRIDE_VARIABLE: f'mode="client";connect/endpoints={json.dumps([endpoint])}', "ROS_DOMAIN_ID": "0"}


def start_simulation(
    directory: Path,
    endpoint: str,
    name: str,
    config: Config = CONFIG,
    options: Sequence[str] = (),
    *,
    forked: bool = True,
) -> Command:
    """Start a simulation; `forked` lets it be forked off a process that has imported its libraries, if there is one."""
    path = directory / "integration.json"
    path.write_text(config.model_dump_json())
    # Simulation and client may be on different backends.
    backend = {VARIABLE: os.environ["SIMULATION_ROS"]} if "SIMULATION_ROS" in os.environ else {}
    words = ("sim", path, "--name", name, *options)
    if forked:
        return start_command(*words, stderr=subprocess.STDOUT, **environment(endpoint), **backend)
    return subprocess.Popen(
        command(*words),
        env={**os.environ, **environment(endpoint), **backend},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@contextmanager
def discovery_server() -> Iterator[str]:
    """The router of a run on Fast DDS, in a process of its own."""
    words = [sys.executable, "-m", "throwcollect", "router", "--listen", "udp/127.0.0.1:0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        listening, _, endpoint = process.stdout.readline().strip().rpartition(" ")
        assert listening == "router listening on"
        yield endpoint
        process.terminate()


@contextmanager
def running_simulation(
    directory: Path, endpoint: str, session: Context, name: str, config: Config = CONFIG
) -> Iterator[Robot]:
    """A simulation, which must end without an error."""
    process = start_simulation(directory, endpoint, name, config)
    try:
        robot = Robot(session, name)
        robot.wait_until_ready(process)
        yield robot
        process.terminate()
        output, _ = process.communicate(timeout=60)
        assert process.returncode == 0, output
    finally:
        # The process is killed even after a failure, so that it does not outlive the tests.
        process.kill()
        process.communicate()
    robot.wait_until_gone()


@contextmanager
def connect(endpoint: str) -> Iterator[Context]:
    """A session of the test's own."""
    context = Context()
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(CONFIG_FILE_VARIABLE, raising=False)
        for variable, value in environment(endpoint).items():
            patch.setenv(variable, value)
        init(context=context)
    try:
        yield context
    finally:
        context.try_shutdown()


def signer() -> Signer:
    """What leases and episodes are signed with: nothing, unless this process has a key."""
    return Signer.of_environment()


def stamp_ns(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def duration(seconds: float) -> Any:
    sec, nanosec = divmod(round(seconds * 1e9), 10**9)
    return Duration(sec=sec, nanosec=nanosec)


def trajectory(controller: str, seconds: float = 1.0, **ends: float) -> Any:
    """From the start posture to other angles of some joints [rad], and to rest there."""
    joints = robot_of(CONFIG).controllers[controller]
    still = [0.0] * len(joints)
    postures = [[POSTURE[joint] for joint in joints], [ends.get(joint, POSTURE[joint]) for joint in joints]]
    points = [
        JointTrajectoryPoint(positions=posture, velocities=still, accelerations=still, time_from_start=duration(time_s))
        for time_s, posture in zip((0.0, seconds), postures, strict=True)
    ]
    return JointTrajectory(joint_names=list(joints), points=points)


def goal(controller: str = ARM, seconds: float = 1.0, **ends: float) -> Any:
    return FollowJointTrajectory.Goal(trajectory=trajectory(controller, seconds, **ends))


def swing(seconds: float = 1.0) -> Any:
    """A goal of the right arm that throws the ball."""
    return goal(ARM, seconds, arm_right_4_joint=-0.5, arm_right_7_joint=0.5)


class Robot:
    """A client of one simulation, spinning whenever it waits."""

    def __init__(self, context: Context, name: str, namespace: str | None = None) -> None:
        self.name = name
        self._prefix = (namespace or f"/{name}").removesuffix("/")
        self.node = Node(f"client_of_{name}", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._actions: dict[str, ActionClient] = {}

    def topic(self, name: str) -> str:
        return f"{self._prefix}/{name}"

    def wait_until(self, condition: Callable[[], bool], what: str = "") -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, f"did not happen: {what}"
            self._executor.spin_once(timeout_sec=0.01)

    def wait_until_ready(self, process: Command) -> None:
        def ready() -> bool:
            assert process.poll() is None, process.communicate()[0]
            return self.node.count_publishers(self.topic("episode")) == 1

        self.wait_until(ready, f"{self.name} is ready")

    def wait_until_gone(self) -> None:
        """Wait until an ended simulation has left the graph, as the next one of its name would seem ready at once."""
        self.wait_until(lambda: not self.node.count_publishers(self.topic("episode")), f"{self.name} is out of sight")

    def result(self, future: Future) -> Any:
        self.wait_until(future.done, "an answer")
        return future.result()

    def ask(self, kind: str, service: str, **fields: Any) -> Future:
        service_type: Any = get_service(kind)
        if service not in self._clients:
            self._clients[service] = self.node.create_client(service_type, self.topic(service))
            assert self._clients[service].wait_for_service(PATIENCE_S), service
        return self._clients[service].call_async(service_type.Request(**fields))

    def call(self, service: str, **fields: Any) -> Any:
        """Call one of the simulation_interfaces services."""
        kind = "".join(word.capitalize() for word in service.split("_"))
        return self.result(self.ask(f"simulation_interfaces/srv/{kind}", service, **fields))

    def parameters(self, service: str, *, node: str | None = None, **fields: Any) -> Any:
        """Call one of the services for parameters, of the simulation's node or of another one in its namespace."""
        kind = "".join(word.capitalize() for word in service.split("_"))
        return self.result(self.ask(f"rcl_interfaces/srv/{kind}", f"{node or self.name}/{service}", **fields))

    def set(self, values: Mapping[str, Any], *, node: str | None = None) -> Any:
        """Set parameters all at once; returns rcl_interfaces/msg/SetParametersResult."""
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        return self.parameters("set_parameters_atomically", node=node, parameters=messages).result

    def publish(self, topic: str, message: Any, qos: QoSProfile | int = 10) -> None:
        """Publish a message once the simulation listens, and wait until it has taken it in."""
        publisher = self.node.create_publisher(type(message), self.topic(topic), qos)
        self.wait_until(lambda: publisher.get_subscription_count() > 0, topic)
        publisher.publish(message)
        self.state()
        self.node.destroy_publisher(publisher)

    def reset(self) -> None:
        assert self.call("reset_simulation").result.result == Result.RESULT_OK

    def put_into(self, state: int) -> Any:
        return self.call("set_simulation_state", state=SimulationState(state=state)).result

    def state(self) -> int:
        return int(self.call("get_simulation_state").state.state)

    def step(self, steps: int) -> Any:
        return self.call("step_simulation", steps=steps).result

    def now_ns(self) -> int:
        """Simulated time."""
        return stamp_ns(self.call("get_entity_state", entity="ball").state.header.stamp)

    def joint(self, name: str) -> float:
        """Measured angle of a joint, by the state of its controller."""
        robot = robot_of(CONFIG)
        controller = robot.controller_of(name)
        kind = "control_msgs/msg/JointTrajectoryControllerState"
        with self.listening(kind, f"{controller}/controller_state") as heard:
            self.wait_until_found(heard)
        return float(heard[-1].feedback.positions[robot.controllers[controller].index(name)])

    def wait_until_found(self, heard: list[Any]) -> None:
        """Wait for a state of a controller: on DDS, nothing else shows that the simulation has found its listener.

        A simulation tells the states of steps only to listeners that it had found before. A request makes an idle one
        look around, and tell its present state.
        """
        self.wait_until(lambda: self.state() in (PLAYING, PAUSED) and bool(heard), "a controller state")

    @contextmanager
    def listening(
        self, kind: str | type[Message], topic: str, qos: QoSProfile = ALL, *, raw: bool = False
    ) -> Iterator[list[Any]]:
        """Messages of a topic heard so far, or their bytes; the simulation knows of the listener."""
        heard: list[Any] = []
        name = topic if topic.startswith("/") else self.topic(topic)
        message_type = get_message(kind) if isinstance(kind, str) else kind
        subscription = self.node.create_subscription(message_type, name, heard.append, qos, raw=raw)
        # The request takes the same way as the subscription, so the simulation knows of it once it answers.
        self.state()
        if ON_DDS:
            # On DDS, they take different ways, and neither side knows when the other one has found it.
            self.wait_until(lambda: subscription.get_publisher_count() > 0, f"somebody publishes {name}")
            found = time.monotonic()
            self.wait_until(lambda: time.monotonic() > found + FOUND_BY_OTHERS_S)
        yield heard
        self.node.destroy_subscription(subscription)

    def action(self, controller: str = ARM) -> ActionClient:
        if controller not in self._actions:
            name = self.topic(f"{controller}/follow_joint_trajectory")
            self._actions[controller] = ActionClient(self.node, FollowJointTrajectory, name)
            assert self._actions[controller].wait_for_server(PATIENCE_S), name
        return self._actions[controller]

    def send(self, wish: Any, controller: str = ARM) -> Any:
        """Send a goal; returns its handle, accepted or not."""
        return self.result(self.action(controller).send_goal_async(wish))

    def outcome(self, handle: Any) -> tuple[int, int, str]:
        """Status, error code and text at the end of a goal."""
        response = self.result(handle.get_result_async())
        return int(response.status), int(response.result.error_code), str(response.result.error_string)
