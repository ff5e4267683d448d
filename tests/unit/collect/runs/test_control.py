import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from rclzenoh.session_config import CONFIG_FILE_VARIABLE, OVERRIDE_VARIABLE
from throwcollect.collect.runs.control import scale
from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.node_collection import MOST_SIMULATIONS, offer_scaling
from throwcollect.collect.runtimes.nodes import LAUNCHER, SIMULATIONS
from throwcollect.collect.runtimes.run_record import RunRecord
from throwcollect.ros import Context, Node, SingleThreadedExecutor
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.router import router
from throwcollect.run_key import RunKey
from throwcollect.state_directory import STATE_VARIABLE


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(STATE_VARIABLE, str(tmp_path / "state"))


RECORD = RunRecord("a-0123", Path("/a"), Path("/a/logs"), 2, Middleware(), RunKey(Path("/a/key")), launcher=1)


def living(endpoint: str | None, runtime: str = "local") -> Run:
    # The run lives until somebody closes what this makes, or the tests end.
    Records().new("a", run="a-0123").write(replace(RECORD, endpoint=endpoint, runtime=runtime))
    return Records().get("a-0123")


@pytest.fixture
def endpoint(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.delenv(CONFIG_FILE_VARIABLE, raising=False)
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    with router("tcp/127.0.0.1:0") as endpoint:
        yield endpoint


@pytest.fixture
def launcher(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    """The node of a launcher with one simulation."""
    monkeypatch.setenv(OVERRIDE_VARIABLE, f'connect/endpoints=["{endpoint}"]')
    context = Context()
    context.init()
    node = Node(LAUNCHER, context=context)
    offer_scaling(node, 1, most=MOST_SIMULATIONS)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    done = threading.Event()

    def serve() -> None:
        while not done.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=serve)
    thread.start()
    yield node
    done.set()
    thread.join()
    context.shutdown()


def test_scaling_asks_the_launcher_for_the_number_of_simulations(endpoint: str, launcher: Node) -> None:
    run = living(endpoint)
    for simulations in (5, 0, 256):
        scale(run, simulations)
        assert launcher.get_parameter(SIMULATIONS).value == simulations
