"""A dataset of slides on the page: its rests are on the map of landings."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.testclient import TestClient
from tests.e2e.collection import collect_here

import throwcollect
from throwcollect.plan.trials import Trial
from throwcollect.serve.throws import encode_throw
from throwcollect.sim.simulator import Simulator

pytest.importorskip("mujoco")
CONFIG = Path(__file__).parents[3] / "configs" / "slide.yaml"


def test_the_rests_of_pucks_are_on_the_map(client: TestClient, tmp_path: Path, remember) -> None:
    collect_here(CONFIG, tmp_path / "data", "--trials", "2", "--set", "sim.engine=mujoco", "--set", "run.replay=0")
    remember("slides", directory=str(tmp_path / "data"))
    dataset = throwcollect.load(tmp_path / "data")
    rests = [tuple(throw.events.rest.position[:2]) for throw in dataset]
    found = client.get("/api/v1/collections/slides/throws").json()
    assert list(zip(found["x_m"], found["y_m"], strict=True)) == rests
    assert (found["noun"], found["end"], found["success"]) == ("slide", "rest", "at_rest")
    simulator = Simulator(dataset.config)
    episode = simulator.run(Trial(0, dataset[0].parameters, 0, ""))
    simulator.close()
    assert f'"landing": [{rests[0][0]}, {rests[0][1]}'.encode() in encode_throw(episode, "sim", {}, ())
