"""Servers slow simulations down for watchers and restore their speed, even after one of the servers is killed."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from tests.unit.serve.conftest import CONFIG, Remember, make_end_fields

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.collect.runtimes.run_record import NodeState
from throwcollect.errors import NotFoundError, WorkerError
from throwcollect.serve import live
from throwcollect.serve.live import restore_abandoned, restore_speed, slow_down

SIM = NodeState("sim_0", "running", 0, "7", "")


class Simulation:
    """A stand-in for a simulation, which records the speeds that it is asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, float]] = []
        self.answers = True
        self.agrees = True

    def set_parameter(self, _run: Run, nodes: list[str], name: str, value: float) -> list[Any]:
        assert name == "sim.real_time_factor"
        if not self.answers:
            raise WorkerError("it does not answer")
        self.asked += [(node, value) for node in nodes]
        return [SimpleNamespace(successful=self.agrees, reason="no") for _ in nodes]


@pytest.fixture
def simulation(monkeypatch: pytest.MonkeyPatch) -> Simulation:
    simulation = Simulation()
    monkeypatch.setattr(live, "set_parameter", simulation.set_parameter)
    return simulation


def make(remember: Remember, tmp_path: Path, name: str = "a", more: str = "", **fields: Any) -> Run:
    directory = tmp_path / "datasets" / name
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "config.yaml").write_text(CONFIG + more)
    remember(name, **{"nodes": (SIM,), **fields})
    return Records().get(name)


def notes(state: Path) -> list[str]:
    """Simulations that are noted as slow."""
    return sorted(note.name for note in (state / "runs" / "a" / "live").glob("*") if note.stat().st_size)


SLOW, FAST = ("/sim_0/sim_0", 1.0), ("/sim_0/sim_0", 0.0)


def test_the_last_watcher_restores_the_speed(
    remember: Remember, tmp_path: Path, state: Path, simulation: Simulation
) -> None:
    run = make(remember, tmp_path)
    one, other = slow_down(run, "sim_0"), slow_down(run, "sim_0")
    restore_speed(run, "sim_0", one)
    assert simulation.asked == [SLOW, SLOW]
    # Another server that starts meanwhile does not restore the speed of a watched simulation.
    restore_abandoned()
    assert simulation.asked == [SLOW, SLOW]
    assert notes(state) == ["sim_0"]
    restore_speed(run, "sim_0", other)
    assert simulation.asked == [SLOW, SLOW, FAST]
    assert notes(state) == []
    restore_speed(run, "sim_0", slow_down(run, "sim_0"))
    assert simulation.asked[3:] == [SLOW, FAST]


def test_the_next_server_restores_speeds_after_a_killed_one(
    remember: Remember, tmp_path: Path, state: Path, simulation: Simulation
) -> None:
    # Closing the lock stands for the death of the server that held it.
    os.close(slow_down(make(remember, tmp_path), "sim_0"))
    restore_abandoned()
    assert simulation.asked == [SLOW, FAST]
    assert notes(state) == []


def test_restoring_the_speed_is_tried_again_if_a_simulation_does_not_answer(
    remember: Remember, tmp_path: Path, state: Path, simulation: Simulation
) -> None:
    run = make(remember, tmp_path)
    lock = slow_down(run, "sim_0")
    simulation.answers = False
    restore_speed(run, "sim_0", lock)
    assert notes(state) == ["sim_0"]
    restore_abandoned()
    assert notes(state) == ["sim_0"]
    simulation.answers = True
    restore_abandoned()
    assert simulation.asked == [SLOW, FAST]
    assert notes(state) == []


@pytest.mark.parametrize("way", ["silent", "unwilling"])
def test_the_speed_is_restored_even_if_slowing_down_failed(
    remember: Remember, tmp_path: Path, state: Path, simulation: Simulation, way: str
) -> None:
    run = make(remember, tmp_path)
    simulation.answers, simulation.agrees = way != "silent", way != "unwilling"
    with pytest.raises(WorkerError, match="does not answer" if way == "silent" else "cannot change its speed: no"):
        slow_down(run, "sim_0")
    simulation.answers = simulation.agrees = True
    restore_abandoned()
    # The simulation may have slowed down although it did not answer.
    assert simulation.asked[-1] == FAST
    assert notes(state) == []


def test_only_running_simulations_can_be_slowed_down(
    remember: Remember, tmp_path: Path, simulation: Simulation
) -> None:
    run = make(remember, tmp_path)
    over = make(remember, tmp_path, "over", **make_end_fields())
    for each, name in ((run, "sim_1"), (run, "../key"), (run, ""), (over, "sim_0")):
        with pytest.raises(NotFoundError, match="no simulation"):
            slow_down(each, name)
    assert simulation.asked == []
