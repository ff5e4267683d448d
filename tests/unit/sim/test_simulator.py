"""A simulator turns a trial into its episode, result and conditions."""

import json
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.dataset.throws_table import judge_episode
from throwcollect.engines.ballistic.ballistic_engine import BallisticEngine
from throwcollect.engines.engine import Observer, Steps
from throwcollect.episode.episode_message import Episode
from throwcollect.errors import MemberError, ThrowcollectError
from throwcollect.sim.present_trial import NO_TRIAL
from throwcollect.sim.simulator import Simulator
from throwcollect.tasks.task import task_of

CONFIG = Config.model_validate({"sim": {"engine": "ballistic"}})
VALUES = {"ball.mass_kg": 0.05, "task.duration_s": 1.1}


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    simulator = Simulator(CONFIG)
    yield simulator
    simulator.close()


def finish(simulator: Simulator) -> Episode:
    while (episode := simulator.hand_over()) is None:
        simulator.step(500)
    assert simulator.hand_over() is None
    return episode


@pytest.mark.parametrize("engine", ["ballistic", "bullet"])
def test_a_trial_has_the_result_that_judging_its_episode_gives(engine: str) -> None:
    config = Config.model_validate({"sim": {"engine": engine}})
    simulator = Simulator(config)
    simulator.begin(3, VALUES)
    assert simulator.trial.leased
    episode = finish(simulator)
    assert not simulator.trial.leased
    trial = with_values(config, VALUES)
    task = task_of(config)
    assert task.columns.from_json(task.outcomes, episode.result) == task.columns.write(judge_episode(trial, episode))
    episode.chunk.check_records()
    *_, values, trajectory = episode.conditions.split("\n")
    assert (values, trajectory) == (json.dumps(VALUES), task_of(trial).trajectory().digest)
    simulator.close()


def test_an_episode_with_numbers_that_are_not_finite_is_an_error(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator.begin(0, {})
    whole = simulator.world.samples

    def spoilt(first: int = 0):
        samples = whole(first)
        if len(samples) > 7:
            samples.effort[7, 0] = np.nan
        return samples

    monkeypatch.setattr(simulator.world, "samples", spoilt)
    with pytest.raises(ThrowcollectError, match="trial 0: effort holds numbers that are not finite, first in sample 7"):
        finish(simulator)


def test_a_dropped_trial_yields_no_episode(simulator: Simulator) -> None:
    simulator.begin(0, VALUES)
    simulator.step(500)
    simulator.drop()
    assert not simulator.trial.leased
    assert simulator.hand_over() is None
    assert simulator.now_ns == 0


def test_after_a_leased_trial_the_physics_are_those_of_the_configuration_again(simulator: Simulator) -> None:
    simulator.begin(3, VALUES)
    finish(simulator)
    assert (simulator.trial.number, simulator.trial.config) == (NO_TRIAL, CONFIG)


@pytest.fixture
def foreign(monkeypatch: pytest.MonkeyPatch) -> Simulator:
    """A simulator whose engine counts as one of another package."""
    monkeypatch.setattr("throwcollect.members.is_own", lambda family, _: family != "engines")
    monkeypatch.setattr("throwcollect.sim.world.load_member", lambda *_: BallisticEngine)
    return Simulator(CONFIG)


def test_a_trial_in_which_the_engine_fails_is_an_error_and_the_next_one_begins(
    foreign: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("boom")

    foreign.begin(0, {})
    with monkeypatch.context() as patch:
        patch.setattr(BallisticEngine, "run", fail)
        with pytest.raises(MemberError, match=r"the engine ballistic cannot take steps: ValueError: boom"):
            foreign.step(500)
    # The reset that drops the trial needs no step, as the start state is known.
    foreign.drop()
    assert foreign.hand_over() is None
    foreign.begin(1, {})
    assert finish(foreign).header.trial == 1


def test_a_sample_of_a_wrong_step_is_an_error_of_the_engine(
    foreign: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Late(BallisticEngine):
        def run(self, steps: Steps, observer: Observer) -> int:
            return super().run(replace(steps, first_sample=steps.first_sample + 1), observer)

    foreign.begin(0, {})
    monkeypatch.setattr(foreign.world.engine, "__class__", Late)
    with pytest.raises(MemberError, match="sample 1 should be of step 2, not 3"):
        foreign.step(500)
