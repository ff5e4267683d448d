"""The genuine ros2 command line tools with a simulation on the embedded backend."""

import os
import subprocess
from collections.abc import Callable, Iterator

import pytest

from tests.integration.robot import POSTURE, environment, start_simulation
from throwcollect.robots.talos import TALOS
from throwcollect.ros.router import router

Ros2 = Callable[..., str]
ALONE = ("--no-daemon", "--spin-time", "2")
ACTION = "control_msgs/action/FollowJointTrajectory"
TORSO = "/sim_0/torso_controller/follow_joint_trajectory"


@pytest.fixture(scope="module")
def ros2(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ros2]:
    """Calls ``ros2`` in the graph of one simulation, and gives what it prints."""
    with router("tcp/127.0.0.1:0") as endpoint, pytest.MonkeyPatch.context() as patch:
        patch.setenv("SIMULATION_ROS", "embedded")
        simulation = start_simulation(tmp_path_factory.mktemp("sim"), endpoint, "sim_0")

        def call(*words: str) -> str:
            found = subprocess.run(
                ["ros2", *words],
                env={**os.environ, **environment(endpoint)},
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert found.returncode == 0, found.stdout + found.stderr
            return found.stdout + found.stderr

        # This command waits for the service, and so for the simulation.
        state = "simulation_interfaces/srv/GetSimulationState"
        assert "SimulationState(state=1)" in call("service", "call", "/sim_0/get_simulation_state", state)
        yield call
        simulation.terminate()
        output, _ = simulation.communicate(timeout=60)
        assert simulation.returncode == 0, output


def test_nodes_and_their_endpoints_are_listed(ros2: Ros2) -> None:
    assert "/sim_0/sim_0" in ros2("node", "list", *ALONE).splitlines()
    info = ros2("node", "info", "/sim_0/sim_0", *ALONE)
    assert "/sim_0/ball/odometry: nav_msgs/msg/Odometry" in info
    assert "/sim_0/reset_simulation: simulation_interfaces/srv/ResetSimulation" in info
    topics = ros2("topic", "list", "-t", *ALONE)
    assert "/sim_0/joint_states [sensor_msgs/msg/JointState]" in topics


def test_topic_info_shows_quality_of_service_and_type_hash(ros2: Ros2) -> None:
    info = ros2("topic", "info", "-v", "/sim_0/robot_description", *ALONE)
    for line in (
        "Node namespace: /sim_0",
        "Topic type hash: RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        "Reliability: RELIABLE",
        "History (Depth): KEEP_LAST (1)",
        "Durability: TRANSIENT_LOCAL",
    ):
        assert line in info


def test_topic_echo_shows_a_latched_message(ros2: Ros2) -> None:
    heard = ros2("topic", "echo", "--once", "--full-length", "/sim_0/robot_description", *ALONE)
    assert 'robot name=\\"talos\\"' in heard


def test_parameters_are_read_described_and_set(ros2: Ros2) -> None:
    node, mass = "/sim_0/sim_0", "ball.mass_kg"
    assert "Double value is: 0.045\n" in ros2("param", "get", node, mass, *ALONE)
    assert "Type: double" in ros2("param", "describe", node, mass, *ALONE)
    assert mass in ros2("param", "list", node, *ALONE)
    assert "successful" in ros2("param", "set", node, mass, "0.05", *ALONE)
    assert "Double value is: 0.05\n" in ros2("param", "get", node, mass, *ALONE)
    refused = ros2("param", "set", node, mass, "-1.0", *ALONE)
    assert "failed" in refused
    assert mass in refused


def test_a_goal_is_carried_out_with_feedback(ros2: Ros2) -> None:
    positions = [POSTURE[joint] for joint in TALOS.controllers["torso_controller"]]
    point = f"{{positions: {positions}, time_from_start: {{sec: 1}}}}"
    goal = f"{{trajectory: {{joint_names: [torso_1_joint, torso_2_joint], points: [{point}]}}}}"
    said = ros2("action", "send_goal", "--feedback", TORSO, ACTION, goal)
    assert "Feedback:" in said
    assert "error_string: Goal successfully reached!" in said
    assert "Goal finished with status: SUCCEEDED" in said


def test_a_goal_for_joints_that_are_not_there_is_refused(ros2: Ros2) -> None:
    goal = "{trajectory: {joint_names: [elbow], points: [{positions: [0.0], time_from_start: {sec: 1}}]}}"
    assert "Goal was rejected." in ros2("action", "send_goal", TORSO, ACTION, goal)
