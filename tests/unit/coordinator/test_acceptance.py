"""Which episodes the coordinator accepts."""

from collections.abc import Iterator

import pytest
from tests.unit.sweep.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.coordinator.acceptance import Acceptance
from throwcollect.episode.episode_message import Episode
from throwcollect.sim.simulator import Simulator
from throwcollect.sweep.plan import Plan

CONFIG = Config.model_validate(
    {"trials": 2, "sweep": {"sampler": "uniform", "parameters": {"ball.mass_kg": {"min": 0.03, "max": 0.06}}}}
)
PLAN: Plan = make_plan(CONFIG)


@pytest.fixture(scope="module")
def episode() -> Iterator[Episode]:
    simulator = Simulator(CONFIG)
    yield simulator.run(PLAN.trials[1])
    simulator.close()


@pytest.fixture(scope="module")
def acceptance() -> Acceptance:
    return Acceptance(CONFIG)


def test_an_episode_of_its_trial_is_accepted(acceptance: Acceptance, episode: Episode) -> None:
    assert acceptance.find_difference(episode.conditions, PLAN, PLAN.trials[1]) is None


def test_an_episode_of_another_trial_is_refused(acceptance: Acceptance, episode: Episode) -> None:
    assert "ball.mass_kg was " in (acceptance.find_difference(episode.conditions, PLAN, PLAN.trials[0]) or "")


def test_an_episode_with_unreadable_conditions_is_refused(acceptance: Acceptance) -> None:
    reason = acceptance.find_difference("{}", PLAN, PLAN.trials[1])
    assert (reason or "").startswith("conditions of the episode: ")
