"""How the coordinator sends leases to a simulation and handles its answers, over a real router."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from rclzenoh.interfaces import get_service
from throwcollect import ros
from throwcollect.collect.coordinator_node import simulation_client
from throwcollect.collect.coordinator_node.simulation_client import SimulationClient
from throwcollect.plan.lease import LEASES, Lease, leases_from_json
from throwcollect.ros import SetParametersResult
from throwcollect.ros.router import router
from throwcollect.run_key import Signer

GetParameters = get_service("rcl_interfaces/srv/GetParameters")
SIGNER = Signer(b"key of the run")


class Bench:
    """A coordinator's client, and a node that stands in for the simulation."""

    def __init__(self, namespace: str = "/sim_0") -> None:
        self.refusals: list[tuple[str, str]] = []
        self.asked: list[tuple[Lease, ...]] = []
        self.accepts = True
        self.executor = ros.SingleThreadedExecutor()
        self.simulation = ros.Node("sim_0", namespace=namespace)
        self.simulation.declare_parameter(LEASES, "")
        self.simulation.add_on_set_parameters_callback(self._consider)
        self.node = ros.Node("coordinator")
        self.client = SimulationClient(
            self.node,
            namespace,
            "sim_0",
            set(),
            make_lease=lambda namespace, trial: Lease.make(namespace, trial, {"ball.mass_kg": 0.05}, SIGNER),
            on_episode=lambda *_: None,
            on_refusal=lambda namespace, reason: self.refusals.append((namespace, reason)),
        )
        self.asking = self.node.create_client(GetParameters, f"{namespace.rstrip('/')}/sim_0/get_parameters")
        self.executor.add_node(self.node)
        self.executor.add_node(self.simulation)
        assert self.spin(self.client.ready)

    def _consider(self, parameters: list[Any]) -> SetParametersResult:
        self.asked.append(leases_from_json(parameters[0].value))
        return SetParametersResult(successful=self.accepts, reason="" if self.accepts else "never")

    @property
    def trials(self) -> list[list[int]]:
        return [[lease.trial for lease in leases] for leases in self.asked]

    def settle(self) -> None:
        """Wait for all answers under way: the answer to one more call arrives after them."""
        done = self.asking.call_async(GetParameters.Request(names=[LEASES]))
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


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(simulation_client, "time", clock)
    return clock


def test_leases_are_sent_signed_and_in_the_given_order(bench: Bench) -> None:
    bench.client.ask([5, 2])
    assert bench.spin(lambda: not bench.client.unanswered)
    (leases,) = bench.asked
    assert [(lease.trial, lease.simulation, dict(lease.values)) for lease in leases] == [
        (5, "/sim_0", {"ball.mass_kg": 0.05}),
        (2, "/sim_0", {"ball.mass_kg": 0.05}),
    ]
    assert all(lease.is_signed(SIGNER) for lease in leases)
    assert bench.refusals == []


@pytest.mark.usefixtures("joined")
def test_a_simulation_may_live_in_the_root_namespace() -> None:
    bench = Bench("/")
    bench.client.ask([5])
    assert bench.spin(lambda: not bench.client.unanswered)
    assert bench.trials == [[5]]


def test_a_simulation_is_not_sent_the_leases_that_it_has(bench: Bench) -> None:
    bench.client.ask([5, 2])
    bench.client.ask([5, 2])
    _, second = bench.client._leases.values()
    bench.client.finish(5)
    bench.client.ask([2])
    bench.client.ask([2, 3])
    bench.settle()
    assert bench.trials == [[5, 2], [2, 3]]
    assert bench.asked[1][0] == second


def test_asking_for_fewer_trials_takes_the_others_back(bench: Bench) -> None:
    bench.client.ask([5, 2])
    bench.client.ask([5])
    bench.settle()
    assert bench.trials == [[5, 2], [5]]
    assert bench.client.trials == (5,)


def test_a_trial_is_waited_for_from_the_end_of_the_one_before_it(bench: Bench, clock: Clock) -> None:
    bench.client.ask([5, 2])
    clock.now += 3
    bench.client.ask([5, 2, 3])
    assert bench.client.began_s == clock.now - 3
    bench.client.finish(5)
    assert (bench.client.trials, bench.client.began_s) == ((2, 3), clock.now)
    clock.now += 3
    bench.client.ask([3])
    assert bench.client.began_s == clock.now
    bench.client.finish(3)
    assert (bench.client.trials, bench.client.began_s) == ((), math.inf)


def test_a_refusal_by_the_simulation_is_reported_with_its_reason(bench: Bench) -> None:
    bench.accepts = False
    bench.client.ask([0])
    assert bench.spin(lambda: bool(bench.refusals))
    assert bench.refusals == [("/sim_0", "leases: never")]


def test_a_late_refusal_does_not_affect_leases_sent_since(bench: Bench) -> None:
    bench.accepts = False
    bench.client.ask([0])
    bench.client.ask([1])
    assert bench.spin(lambda: not bench.client.unanswered)
    bench.settle()
    assert bench.trials == [[0], [1]]
    assert len(bench.refusals) == 1


def test_answers_about_abandoned_trials_are_ignored(bench: Bench) -> None:
    bench.accepts = False
    bench.client.ask([0])
    bench.client.abandon()
    bench.settle()
    assert bench.trials == [[0]]
    assert bench.refusals == []


def test_trials_without_an_answer_are_sent_again_with_the_same_leases(bench: Bench, clock: Clock) -> None:
    bench.client.ask([5, 6])
    assert bench.client.remind() is None
    clock.now += 5
    # The simulation has not answered yet, as nothing was spun.
    assert bench.client.remind() == "2 trials"
    bench.settle()
    assert bench.trials == [[5, 6], [5, 6]]
    assert bench.asked[0] == bench.asked[1]
    assert bench.client.remind() is None


def test_a_simulation_that_answered_and_hands_nothing_over_is_asked_again_with_new_leases(
    bench: Bench, clock: Clock
) -> None:
    bench.client.ask([5, 6])
    assert bench.spin(lambda: not bench.client.unanswered)
    clock.now += 4
    bench.client.finish(5)
    clock.now += 4
    assert bench.client.remind() is None
    # The simulation was heard of 4 s ago, so nothing was sent.
    assert not bench.client.unanswered
    clock.now += 1
    # There was an answer, so nothing is missing.
    assert bench.client.remind() is None
    assert bench.spin(lambda: not bench.client.unanswered)
    assert bench.trials == [[5, 6], [6]]
    assert bench.asked[1][0].token not in {lease.token for lease in bench.asked[0]}


def test_a_simulation_that_answers_slowly_is_asked_again_later_each_time(bench: Bench, clock: Clock) -> None:
    bench.client.ask([0])
    for wait_s in (5, 10):
        clock.now += wait_s - 1
        assert bench.client.remind() is None
        clock.now += 1
        assert bench.client.remind() == "1 trial"
    clock.now += 3
    assert bench.spin(lambda: not bench.client.unanswered)
    # The first of the three answers took 18 s, of which 90 % count after each of the others, four times.
    bench.client.ask([0, 1])
    clock.now += 58
    assert bench.client.remind() is None
    assert bench.client.alive
    clock.now += 1
    assert bench.client.remind() == "2 trials"


def test_a_simulation_that_has_never_answered_is_not_alive(bench: Bench, clock: Clock) -> None:
    bench.client.ask([0])
    assert not bench.client.alive
    assert bench.spin(lambda: not bench.client.unanswered)
    assert bench.client.alive
    clock.now += 5
    assert not bench.client.alive


def test_abandoned_trials_are_not_sent_again(bench: Bench, clock: Clock) -> None:
    bench.client.ask([0])
    clock.now += 5
    bench.client.abandon()
    assert bench.client.remind() is None
