"""Simulations in the ROS graph, with and without working services, over a real router."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.unit.sweep.own_plan import make_plan

from throwcollect import ros
from throwcollect.config.loader import load
from throwcollect.coordinator import coordinator_node as coordinator_node
from throwcollect.coordinator.collection import TrialCollection
from throwcollect.coordinator.coordinator_node import Coordinator
from throwcollect.dataset.creation import create
from throwcollect.dataset.writer import DatasetWriter
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
        (directory / "reach.yaml").write_text(YAML + more)
        plan = make_plan(load(directory / "reach.yaml"))
        create(directory / "data", plan)
        self.writer = DatasetWriter.open(directory / "data")
        self.coordinator = Coordinator(TrialCollection(self.writer, directory / "data"))
        self.executor = ros.SingleThreadedExecutor()
        self.executor.add_node(self.coordinator)

    def simulation(self, *, whole: bool) -> ros.Node:
        node = ros.Node("sim_0", namespace="/sim_0", start_parameter_services=whole)
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


SLOWED = "run: {{trial_timeout_s: 1.5}}\nsim: {{max_trial_s: 8, real_time_factor: {factor}}}\n"


@pytest.mark.parametrize(
    ("bench", "patience_s"),
    [(SLOWED.format(factor=factor), patience_s) for factor, patience_s in (("null", 9.5), (20, 9.5), (0.5, 17.5))],
    indirect=["bench"],
)
def test_a_trial_slower_than_real_time_has_a_longer_timeout(bench: Bench, patience_s: float) -> None:
    assert bench.coordinator._patience_s == patience_s
