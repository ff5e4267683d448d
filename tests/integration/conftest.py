"""A router and one simulation in a process of its own, for all tests of a session.

Runs of tests are remembered apart from those of the user: each looks at all that are remembered.

Nodes on Fast DDS meet as those of a run do: at a discovery server.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

from rclzenoh.parameter import parameter_value_to_python
from tests.commands import Command
from tests.integration.robot import (
    OWN,
    PAUSED,
    PLAYING,
    Robot,
    connect,
    discovery_server,
    running_simulation,
    start_simulation,
)
from throwcollect.ros import Context
from throwcollect.ros.middleware import Middleware, uses_rclpy
from throwcollect.ros.router import router

NAME = "sim_0"


@pytest.fixture(scope="session", autouse=True)
def _forked_commands(request: pytest.FixtureRequest) -> None:
    # Libraries of genuine ROS 2 may not survive a fork, so their simulations start by themselves.
    if not uses_rclpy():
        request.getfixturevalue("commands")


@pytest.fixture(scope="session")
def endpoint() -> Iterator[str]:
    with discovery_server() if Middleware.of_process().is_fast_dds else router("tcp/127.0.0.1:0") as endpoint:
        yield endpoint


@pytest.fixture(scope="session")
def session(endpoint: str) -> Iterator[Context]:
    with connect(endpoint) as context:
        yield context


@pytest.fixture(scope="session")
def shared(endpoint: str, session: Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    with running_simulation(tmp_path_factory.mktemp("sim"), endpoint, session, NAME) as robot:
        yield robot


@pytest.fixture(scope="session")
def defaults(shared: Robot) -> dict[str, object]:
    """Values of all parameters that can be set when the simulation has just started."""
    names = shared.parameters("list_parameters").result.names
    described = shared.parameters("describe_parameters", names=names).descriptors
    names = [each.name for each in described if not each.read_only]
    values = shared.parameters("get_parameters", names=names).values
    return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=True)}


@pytest.fixture
def robot(shared: Robot, defaults: dict[str, object]) -> Iterator[Robot]:
    """The simulation, reset to the state in which it had just started.

    It is paused after the test: one that idles takes an eighth of a core, and the tests without it last for minutes.
    """
    assert shared.set(defaults).successful
    if shared.state() != PLAYING:
        shared.put_into(PLAYING)
    shared.reset()
    yield shared
    shared.put_into(PAUSED)


@pytest.fixture
def running(
    request: pytest.FixtureRequest, endpoint: str, session: Context, tmp_path: Path
) -> Iterator[tuple[Command, Robot]]:
    """The process of a simulation of the test's own, which it may end, and a client.

    With the parameter "by itself" it is no fork, and ends as an interpreter does.
    """
    process = start_simulation(tmp_path, endpoint, OWN, forked=getattr(request, "param", None) != "by itself")
    try:
        robot = Robot(session, OWN)
        robot.wait_until_ready(process)
        yield process, robot
    finally:
        process.kill()
        process.communicate()
    robot.wait_until_gone()
    # This comes last: a session of rmw_zenoh_cpp hangs for good if a client is destroyed during its last answer.
    robot.node.destroy_node()
