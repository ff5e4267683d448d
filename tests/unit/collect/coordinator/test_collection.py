"""What happens to leased trials when their simulation delivers, dies or sends a wrong episode."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.unit.plan.own_plan import make_plan

from throwcollect.collect.coordinator.collection import TrialCollection
from throwcollect.collect.coordinator.prefetch import Prefetch
from throwcollect.config.schema import Config
from throwcollect.dataset.creation import create
from throwcollect.dataset.provenance import read_provenance
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import LossError
from throwcollect.plan.plan import Plan
from throwcollect.sim.simulator import Simulator

PLAN: Plan = make_plan(
    Config.model_validate(
        {
            "name": "leased",
            "trials": 6,
            "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}},
            "sim": {"engine": "ballistic"},
            "run": {"retries": 0, "replay": 0},
        }
    )
)


def change(episode: Episode, *, result: str | None = None, conditions: str | None = None) -> Episode:
    return Episode(
        episode.header, episode.chunk, result=result or episode.result, conditions=conditions or episode.conditions
    )


@pytest.fixture
def collection(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TrialCollection]:
    monkeypatch.setattr(Prefetch, "count_for", lambda *_, **__: 4)
    create(tmp_path / "data", PLAN)
    with TrialCollection.open(tmp_path / "data", say=print) as collection:
        collection.join("/sim_0", "sim_0")
        yield collection


@pytest.fixture(scope="module")
def deliveries() -> list[Episode]:
    simulator = Simulator(PLAN.config)
    found = [simulator.run(trial) for trial in PLAN.trials]
    simulator.close()
    return found


def events(directory: Path, kind: str) -> list[dict[str, Any]]:
    lines = (directory / "data" / "logs" / "journal.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if event["event"] == kind]


def test_a_simulation_that_dies_loses_only_the_trial_that_it_ran(
    collection: TrialCollection, deliveries: list[Episode], tmp_path: Path
) -> None:
    assert collection.lease("/sim_0") == (0, 1, 2, 3)
    assert collection.take_in("/sim_0", deliveries[0])
    collection.leave("/sim_0", "left the ROS graph")
    assert [(event["trial"], event["reason"]) for event in events(tmp_path, "fail")] == [(1, "left the ROS graph")]
    assert not events(tmp_path, "lost")
    collection.settle("/sim_0", alive=False)
    assert [event["trial"] for event in events(tmp_path, "lost")] == [1]
    collection.join("/sim_1", "sim_1")
    assert collection.lease("/sim_1") == (2, 3, 4, 5)
    for trial in (2, 3, 4, 5):
        collection.take_in("/sim_1", deliveries[trial])
    assert collection.complete
    assert collection.progress().outcomes == {"landed": 5, "lost": 1}
    with pytest.raises(LossError):
        collection.finish(meanwhile=lambda: None, say=print)
    provenance = read_provenance(tmp_path / "data")
    assert provenance is not None
    assert provenance.simulations == 2


def test_a_simulation_that_comes_back_has_lost_no_trial(
    collection: TrialCollection, deliveries: list[Episode], tmp_path: Path
) -> None:
    for _ in range(5):
        assert collection.lease("/sim_0") == (0, 1, 2, 3)
        collection.leave("/sim_0", "left the ROS graph")
        collection.settle("/sim_0", alive=True)
        collection.join("/sim_0", "sim_0")
    assert not events(tmp_path, "lost")


def test_the_first_episode_of_a_trial_counts_and_later_ones_are_dropped(
    collection: TrialCollection, deliveries: list[Episode], tmp_path: Path
) -> None:
    warnings: list[str] = []
    collection.lease("/sim_0")
    collection.take_back("/sim_0", "no episode within 66 s", alive=True)
    collection.warn = warnings.append
    collection.join("/sim_1", "sim_1")
    assert collection.lease("/sim_1") == (0, 1, 2, 3)
    assert collection.take_in("/sim_0", deliveries[0])
    assert collection.lease("/sim_1") == (1, 2, 3)
    for simulation in ("/sim_0", "/sim_1"):
        assert not collection.take_in(simulation, deliveries[0])
    assert not collection.take_in("/sim_1", deliveries[0])
    assert [event["trial"] for event in events(tmp_path, "commit")] == [0]
    assert not warnings


def test_a_wrong_episode_of_a_trial_that_its_simulation_does_not_hold_changes_nothing(
    collection: TrialCollection, deliveries: list[Episode], tmp_path: Path
) -> None:
    collection.join("/sim_1", "sim_1")
    collection.lease("/sim_0")
    wrong = change(deliveries[0], conditions=deliveries[1].conditions)
    assert not collection.take_in("/sim_1", wrong)
    collection.refuse("/sim_1", 0, "cannot be done")
    assert collection.lease("/sim_0") == (0, 1, 2, 3)
    assert not events(tmp_path, "fail")


def test_a_simulation_that_computes_another_motion_is_refused_at_its_first_episode(
    collection: TrialCollection, deliveries: list[Episode]
) -> None:
    said: list[str] = []
    collection.warn = said.append
    collection.lease("/sim_0")
    same = deliveries[0].conditions.rpartition("\n")[0]
    assert not collection.take_in("/sim_0", change(deliveries[0], conditions=f"{same}\nanother motion"))
    assert "its controllers were given another trajectory" in said[0]
    assert collection.take_in("/sim_0", deliveries[1])


def test_a_simulation_gets_more_trials_once_half_of_its_lease_is_done(
    collection: TrialCollection, deliveries: list[Episode]
) -> None:
    assert collection.lease("/sim_0") == (0, 1, 2, 3)
    collection.take_in("/sim_0", deliveries[0])
    assert collection.lease("/sim_0") == (1, 2, 3)
    collection.take_in("/sim_0", deliveries[1])
    assert collection.lease("/sim_0") == (2, 3, 4, 5)


def test_draining_leaves_each_simulation_only_the_trial_that_runs(
    collection: TrialCollection, deliveries: list[Episode]
) -> None:
    changes: list[tuple[int, ...]] = []
    collection.on_change = lambda: changes.append(collection.lease("/sim_0"))
    collection.lease("/sim_0")
    collection.drain()
    assert changes == [(0,)]
    assert not collection.finished
    collection.take_in("/sim_0", deliveries[0])
    assert collection.lease("/sim_0") == ()
    assert collection.finished


def test_a_trial_without_retries_whose_episode_is_refused_is_lost(
    collection: TrialCollection, deliveries: list[Episode]
) -> None:
    said: list[str] = []
    collection.warn = said.append
    collection.lease("/sim_0")
    assert not collection.take_in("/sim_0", change(deliveries[0], conditions=deliveries[1].conditions))
    assert not collection.take_in("/sim_0", change(deliveries[1], result="{}"))
    assert "trial 0 is lost: its episode is refused: its values are not those of the plan" in said[0]
    assert "trial 1 is lost: its episode is refused: result of a trial: " in said[1]
    assert collection.progress().outcomes == {"lost": 2}
