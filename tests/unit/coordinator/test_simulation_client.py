"""What the coordinator makes of a simulation's answers, over a real router."""

import time
from collections.abc import Callable, Iterator

import pytest

from rclzenoh.interfaces import get_service
from throwcollect import ros
from throwcollect.config.schema import Config
from throwcollect.coordinator.goals import FollowJointTrajectory, goal_message, trial_goals
from throwcollect.coordinator.simulation_client import SimulationClient
from throwcollect.robots.description import start_posture
from throwcollect.robots.talos import TALOS
from throwcollect.ros import ActionServer, GoalResponse
from throwcollect.ros.router import router
from throwcollect.tasks.task import task_of
from throwcollect.trial.lease import Lease

GetParameters = get_service("rcl_interfaces/srv/GetParameters")
NAMING = "ros1"
CONFIG = Config()
GOALS = {
    name: goal_message(goal)
    for name, goal in trial_goals(TALOS, task_of(CONFIG).trajectory(), start_posture(CONFIG)).items()
}


def lease(trial: int, **values: float) -> Lease:
    named = {key.replace("__", "."): value for key, value in values.items()}
    return Lease("/sim_0", trial, tuple(GOALS), named)


class Bench:
    """A coordinator's client, and a node that stands in for the simulation."""

    def __init__(self, namespace: str = "/sim_0") -> None:
        self.refusals: list[tuple[str, str]] = []
        self.requests: list[str] = []
        self.accepts = True
        self.executor = ros.SingleThreadedExecutor()
        self.simulation = ros.Node("sim_0", namespace=namespace)
        self.simulation.declare_parameter("trial.number", -1)
        self.simulation.declare_parameter("trial.controllers", [""])
        self.simulation.declare_parameter("ball.mass_kg", 0.045)
        self.simulation.declare_parameter("trial.lease", "")
        self.servers: list[ActionServer] = []
        for controller in GOALS:
            self.offer(controller)
        self.node = ros.Node("coordinator")
        self.client = SimulationClient(
            self.node,
            namespace,
            "sim_0",
            set(),
            controllers={name: TALOS.graph_name(name, NAMING) for name in GOALS},
            action_type=FollowJointTrajectory,
            on_episode=lambda *_: None,
            on_refusal=lambda namespace, reason: self.refusals.append((namespace, reason)),
        )
        self.asking = self.node.create_client(GetParameters, f"{namespace.rstrip('/')}/sim_0/get_parameters")
        self.executor.add_node(self.node)
        self.executor.add_node(self.simulation)
        assert self.spin(self.client.ready)

    def offer(self, controller: str) -> None:
        name = f"{TALOS.graph_name(controller, NAMING)}/follow_joint_trajectory"
        server = ActionServer(self.simulation, FollowJointTrajectory, name, self._execute, goal_callback=self._consider)
        self.servers.append(server)

    def _consider(self, _goal):
        self.requests.append("goal")
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    def _execute(self, handle):
        handle.succeed()
        return FollowJointTrajectory.Result()

    def settle(self) -> None:
        """Let every answer that is under way arrive: those of a further call come after them."""
        done = self.asking.call_async(GetParameters.Request(names=["trial.number"]))
        assert self.spin(done.done)

    def spin(self, condition: Callable[[], bool]) -> bool:
        deadline = time.monotonic() + 10
        while not condition() and time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.05)
        return condition()


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with router("tcp/127.0.0.1:0") as endpoint:
        monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'mode="client";connect/endpoints=["{endpoint}"]')
        ros.init()
        try:
            yield
        finally:
            ros.shutdown()


@pytest.fixture
def bench(joined: None) -> Bench:
    return Bench()


def test_a_trial_is_a_lease_and_then_goals(bench: Bench) -> None:
    bench.client.begin(lease(5, ball__mass_kg=0.05), "token", GOALS)
    assert bench.spin(lambda: len(bench.requests) == 2)
    assert bench.requests == ["goal", "goal"]
    assert bench.simulation.get_parameter("trial.lease").value == bench.client.token == "token"
    assert bench.simulation.get_parameter("trial.number").value == 5
    assert tuple(bench.simulation.get_parameter("trial.controllers").value) == tuple(GOALS)
    assert bench.simulation.get_parameter("ball.mass_kg").value == 0.05
    assert bench.refusals == []


@pytest.mark.usefixtures("joined")
def test_a_simulation_may_live_in_the_root_namespace() -> None:
    bench = Bench("/")
    bench.client.begin(lease(5), "token", GOALS)
    assert bench.spin(lambda: len(bench.requests) == 2)
    assert bench.simulation.get_parameter("trial.number").value == 5


def test_refused_goals_are_reported(bench: Bench) -> None:
    bench.accepts = False
    bench.client.begin(lease(0), "token", GOALS)
    assert bench.spin(lambda: len(bench.refusals) == 2)
    assert bench.refusals[0] == ("/sim_0", "arm_right_controller refused the goal; its log says why")


def test_refused_parameters_are_reported_with_the_reason(bench: Bench) -> None:
    bench.client.begin(lease(0, ball__colour=1.0), "token", GOALS)
    assert bench.spin(lambda: bool(bench.refusals))
    assert bench.refusals[0][1].startswith("parameters: ")


def test_a_late_refusal_does_not_touch_the_next_trial(bench: Bench) -> None:
    bench.accepts = False
    bench.client.begin(lease(0), "token", GOALS)
    assert bench.spin(lambda: bench.requests.count("goal") == 1)
    bench.client.begin(lease(1), "token", GOALS)
    assert bench.spin(lambda: bench.requests.count("goal") == 4)
    bench.settle()
    assert len(bench.refusals) == 2


def test_an_abandoned_trial_is_not_heard_of_again(bench: Bench) -> None:
    bench.accepts = False
    bench.client.begin(lease(0), "token", GOALS)
    assert bench.spin(lambda: bench.requests.count("goal") == 1)
    bench.client.abandon()
    bench.settle()
    assert bench.requests.count("goal") == 2
    assert bench.refusals == []


def test_an_abandoned_trial_goes_no_further(bench: Bench) -> None:
    bench.client.begin(lease(0), "token", GOALS)
    bench.client.abandon()
    bench.settle()
    bench.settle()
    assert "goal" not in bench.requests


def test_what_has_no_answer_is_sent_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.client.begin(lease(5), "token", GOALS)
    assert bench.client.remind() is None
    monkeypatch.setattr(bench.client, "_patience_s", 0.0)
    # The simulation has not had a chance to answer yet; the goals of the first attempt must not follow those of this.
    assert bench.client.remind() == "the lease"
    assert bench.spin(lambda: not bench.client.unanswered)
    assert bench.requests == ["goal", "goal"]
    assert bench.client.remind() is None
    assert bench.refusals == []


def test_a_goal_that_got_lost_has_its_trial_begun_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    lost = bench.servers.pop()
    lost.destroy()
    bench.client.begin(lease(5), "token", GOALS)
    *_, last = GOALS
    assert bench.spin(lambda: bench.client.unanswered == [last])
    monkeypatch.setattr(bench.client, "_patience_s", 0.0)
    bench.offer(last)
    assert bench.client.remind() == last
    assert bench.spin(lambda: not bench.client.unanswered)
    assert bench.requests == ["goal"] * 3


def test_nothing_is_missing_of_an_abandoned_trial(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.client.begin(lease(0), "token", GOALS)
    monkeypatch.setattr(bench.client, "_patience_s", 0.0)
    bench.client.abandon()
    assert bench.client.remind() is None
