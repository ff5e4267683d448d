"""Simulations in the ROS graph, with and without working services, over a real router."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.unit.plan.own_plan import make_plan

from throwcollect import ros
from throwcollect.collect.coordinator.collection import TrialCollection
from throwcollect.collect.coordinator_node import node as coordinator_node
from throwcollect.collect.coordinator_node.node import Coordinator
from throwcollect.config.loader import load
from throwcollect.dataset.creation import create
from throwcollect.dataset.writer import DatasetWriter
from throwcollect.plan.lease import LEASES
from throwcollect.ros import get_message
from throwcollect.ros.router import router

UInt8MultiArray: Any = get_message("std_msgs/msg/UInt8MultiArray")
YAML = """\
name: reach
trials: 2
sweep: {sampler: uniform, parameters: {task.duration_s: {min: 1.0, max: 1.2}}}
"""


class Bench:
    """A coordinator, and nodes that look like simulations."""

    def __init__(self, directory: Path, more: str = "") -> None:
        self.directory = directory
        (directory / "reach.yaml").write_text(YAML + more)
        plan = make_plan(load(directory / "reach.yaml"))
        create(directory / "data", plan)
        self.writer = DatasetWriter.open(directory / "data")
        self.coordinator = Coordinator(TrialCollection(self.writer, directory / "data"))
        self.executor = ros.SingleThreadedExecutor()
        self.executor.add_node(self.coordinator)

    def simulation(self, *, whole: bool) -> ros.Node:
        node = ros.Node("sim_0", namespace="/sim_0", start_parameter_services=whole)
        node.declare_parameter(LEASES, "")
        self.executor.add_node(node)
        node.create_publisher(UInt8MultiArray, "episode", 10)
        return node

    def until(self, condition: Callable[[], bool], seconds: float = 5.0) -> bool:
        deadline = time.monotonic() + seconds
        while not condition() and time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)
        return condition()

    @property
    def hung(self) -> list[str]:
        return self.coordinator.report().hung

    def reasons(self, kind: str) -> list[str]:
        """The reasons of all entries of a kind in the journal."""
        lines = (self.directory / "data" / "logs" / "journal.jsonl").read_text().splitlines()
        return [entry["reason"] for entry in map(json.loads, lines) if entry["event"] == kind]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    monkeypatch.setattr(coordinator_node, "_REACH_S", 0.5)
    with router("tcp/127.0.0.1:0") as endpoint:
        monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'mode="client";connect/endpoints=["{endpoint}"]')
        ros.init()
        bench = Bench(tmp_path, getattr(request, "param", ""))
        try:
            yield bench
        finally:
            bench.writer.close()
            ros.shutdown()


def test_a_simulation_without_parameter_services_is_reported_as_hung(bench: Bench) -> None:
    node = bench.simulation(whole=False)
    assert bench.until(lambda: bench.coordinator.report().simulations == 1)
    assert bench.hung == []
    assert bench.until(lambda: bench.hung == ["sim_0"])
    node.destroy_node()
    assert bench.until(lambda: bench.hung == [])


def test_a_simulation_with_parameter_services_is_not_reported_as_hung(bench: Bench) -> None:
    bench.simulation(whole=True)
    assert bench.until(lambda: bench.coordinator.report().simulations == 1)
    assert not bench.until(lambda: bench.hung != [], seconds=1.5)


def test_a_restarted_simulation_replaces_its_predecessor(bench: Bench) -> None:
    first = bench.simulation(whole=True)
    assert bench.until(lambda: bench.coordinator.report().simulations == 1)
    (before,) = bench.coordinator._simulations.values()
    # The second simulation appears before the first one is gone.
    second = ros.Node("sim_0", namespace="/sim_0")
    second.create_publisher(UInt8MultiArray, "episode", 10)
    assert bench.until(lambda: list(bench.coordinator._simulations.values()) != [before])
    first.destroy_node()
    second.destroy_node()


@pytest.mark.parametrize("bench", ["run: {retries: 0}\n"], indirect=True)
def test_a_simulation_that_answers_but_is_slow_loses_no_trial_and_gives_all_more_time(bench: Bench) -> None:
    bench.simulation(whole=True)
    assert bench.until(lambda: any(client.alive for client in bench.coordinator._simulations.values()))
    bench.coordinator._patience_s = 0.1
    assert bench.until(lambda: bench.hung == ["sim_0"])
    assert bench.reasons("fail") == ["no episode within 0.1 s"]
    assert bench.reasons("lost") == []
    assert bench.coordinator._patience_s == 0.2


@pytest.mark.parametrize("bench", ["run: {retries: 0}\n"], indirect=True)
def test_a_simulation_that_never_answers_loses_its_trial(bench: Bench) -> None:
    bench.executor.remove_node(bench.simulation(whole=True))
    assert bench.until(lambda: any(client.trials for client in bench.coordinator._simulations.values()))
    bench.coordinator._patience_s = 0.1
    assert bench.until(lambda: bench.hung == ["sim_0"])
    assert bench.reasons("lost") == ["/sim_0: no episode within 0.1 s, and no answer to the lease"]
    assert bench.coordinator._patience_s == 0.1


@pytest.mark.parametrize("bench", ["run: {retries: 0}\n"], indirect=True)
def test_a_simulation_whose_connection_was_cut_loses_no_trial_but_one_that_was_restarted_does(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = bench.simulation(whole=True)
    for cut in (True, True, False):
        assert bench.until(lambda: any(client.trials for client in bench.coordinator._simulations.values()))
        if cut:
            with monkeypatch.context() as context:
                context.setattr(bench.coordinator, "_find_offers", lambda: iter(()))
                bench.coordinator._find_simulations()
        else:
            node.destroy_node()
        assert bench.until(lambda: bench.coordinator.report().simulations == 0)
        if not cut:
            bench.simulation(whole=True)
        else:
            bench.coordinator._find_simulations()
        assert bench.until(lambda: bench.coordinator.report().simulations == 1)
    assert bench.reasons("fail") == ["left the ROS graph"] * 3
    assert bench.reasons("lost") == ["/sim_0: left the ROS graph"]


@pytest.mark.parametrize("bench", ["run: {retries: 0}\n"], indirect=True)
def test_a_simulation_that_does_not_come_back_loses_its_trial_when_its_time_is_up(bench: Bench) -> None:
    node = bench.simulation(whole=True)
    assert bench.until(lambda: any(client.trials for client in bench.coordinator._simulations.values()))
    node.destroy_node()
    assert bench.until(lambda: bench.reasons("fail") == ["left the ROS graph"])
    assert bench.reasons("lost") == []
    bench.coordinator._patience_s = 0.0
    assert bench.until(lambda: bench.reasons("lost") == ["/sim_0: left the ROS graph"])


SLOWED = "run: {{trial_timeout_s: 1.5}}\nsim: {{max_trial_s: 8, real_time_factor: {factor}}}\n"


@pytest.mark.parametrize(
    ("bench", "patience_s"),
    [(SLOWED.format(factor=factor), patience_s) for factor, patience_s in (("null", 9.5), (20, 9.5), (0.5, 17.5))],
    indirect=["bench"],
)
def test_a_trial_slower_than_real_time_has_a_longer_timeout(bench: Bench, patience_s: float) -> None:
    assert bench.coordinator._patience_s == patience_s
