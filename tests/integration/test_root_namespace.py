"""A simulation in the root namespace, where clients of the real Talos look for it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.integration.robot import ARM, OWN, Robot, connect, start_simulation, swing
from throwcollect.ros import Node, Parameter, SingleThreadedExecutor
from throwcollect.ros.router import router

_NAMES = ("/clock", "/tf", "/tf_static", "/joint_states", "/robot_description", f"/{ARM}/controller_state")


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """A router of this module's own, so that this simulation does not meet the others."""
    with router("tcp/127.0.0.1:0") as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def talos(endpoint: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    process = start_simulation(tmp_path_factory.mktemp("root"), endpoint, OWN, options=("--namespace", "/"))
    with connect(endpoint) as context:
        robot = Robot(context, OWN, "/")
        robot.wait_until_ready(process)
        yield robot
    process.terminate()
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0, output


def test_topics_have_the_names_of_the_real_robot(talos: Robot) -> None:
    assert {name for name, _ in talos.node.get_topic_names_and_types()} >= set(_NAMES)
    assert talos.outcome(talos.send(swing(0.3)))[1] == 0
    assert talos.set({"ball.mass_kg": 0.05}).successful
    assert (OWN, "/") in talos.node.get_node_names_and_namespaces()


def test_a_node_with_simulated_time_follows_the_simulation(talos: Robot) -> None:
    node = Node("follower", context=talos.node.context)
    node.set_parameters([Parameter("use_sim_time", value=True)])
    executor = SingleThreadedExecutor(context=talos.node.context)
    executor.add_node(node)

    def told() -> bool:
        executor.spin_once(timeout_sec=0.01)
        return bool(node.get_clock().now().nanoseconds)

    assert talos.send(swing(0.3)).accepted
    talos.wait_until(told, "simulated time")
    assert node.get_clock().now().nanoseconds < 60 * 10**9
    node.destroy_node()


@pytest.mark.usefixtures("talos")
def test_a_second_simulation_in_the_root_namespace_is_refused(endpoint: str, tmp_path: Path) -> None:
    process = start_simulation(tmp_path, endpoint, "sim_2", options=("--namespace", "/"))
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 2
    assert f"namespace /: the simulation {OWN} lives there" in output
    assert "Traceback" not in output
