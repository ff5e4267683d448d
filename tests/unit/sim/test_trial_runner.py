"""The trial runner turns a leased trial into episode, result and conditions."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.config.values import with_values
from throwcollect.control import ErrorCode, TrajectoryRefusal
from throwcollect.dataset.judging import judge_episode
from throwcollect.engines.ballistic.ballistic_engine import BallisticEngine
from throwcollect.engines.engine import Observer, Steps
from throwcollect.episode.episode_message import Delivery
from throwcollect.errors import ConfigError, MemberError, ThrowcollectError
from throwcollect.sim.limb_controller import LimbController
from throwcollect.sim.present_trial import TrialSetup
from throwcollect.sim.simulation import Simulation, StateCode
from throwcollect.sim.trial_runner import TrialRunner
from throwcollect.tasks.task import task_of
from throwcollect.trial.conditions import conditions_from_json

CONFIG = Config.model_validate({"sim": {"engine": "ballistic"}})
VALUES = {"ball.mass_kg": 0.05, "task.duration_s": 1.1}


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    simulation = Simulation(CONFIG)
    yield simulation
    simulation.world.close()


def finish(runner: TrialRunner, simulation: Simulation) -> Delivery:
    while (delivery := runner.hand_over()) is None:
        simulation.advance(watched=False)
    assert runner.hand_over() is None
    return delivery


@pytest.mark.parametrize("engine", ["ballistic", "bullet"])
def test_a_trial_has_the_result_that_judging_its_episode_gives(engine: str) -> None:
    config = Config.model_validate({"sim": {"engine": engine}})
    simulation = Simulation(config)
    runner = TrialRunner(simulation)
    runner.begin(3, VALUES)
    assert simulation.trial.leased
    delivery = finish(runner, simulation)
    assert not simulation.trial.leased
    trial = with_values(config, VALUES)
    task = task_of(config)
    assert task.columns.from_json(task.outcomes, delivery.result) == judge_episode(trial, delivery.episode)
    delivery.episode.chunk.check_records()
    conditions = conditions_from_json(delivery.conditions)
    assert conditions.values == {"ball.mass_kg": 0.05}
    assert conditions.trajectory == task_of(trial).trajectory().digest
    simulation.world.close()


def test_a_trial_that_cannot_begin_is_an_error(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    runner = TrialRunner(simulation)
    with pytest.raises(ConfigError):
        runner.begin(0, {"ball.colour": 1.0})
    monkeypatch.setattr(
        LimbController, "refuse_locked", lambda *_: TrajectoryRefusal(ErrorCode.INVALID_JOINTS, "is locked")
    )
    with pytest.raises(ThrowcollectError, match="trial 0: arm_right_controller refuses its goal"):
        runner.begin(0, {})


def test_an_episode_with_numbers_that_are_not_finite_is_an_error(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    runner = TrialRunner(simulation)
    runner.begin(0, {})
    whole = simulation.world.samples

    def spoilt(first: int = 0):
        samples = whole(first)
        if len(samples) > 7:
            samples.effort[7, 0] = np.nan
        return samples

    monkeypatch.setattr(simulation.world, "samples", spoilt)
    with pytest.raises(ThrowcollectError, match="trial 0: effort holds numbers that are not finite, first in sample 7"):
        finish(runner, simulation)


def test_a_dropped_trial_yields_no_episode(simulation: Simulation) -> None:
    runner = TrialRunner(simulation)
    runner.begin(0, VALUES)
    simulation.advance(watched=False)
    runner.drop()
    assert not simulation.running
    assert not simulation.trial.leased
    assert runner.hand_over() is None
    assert simulation.now_ns == 0


def test_a_setup_during_a_trial_is_only_for_the_next_one(simulation: Simulation) -> None:
    runner = TrialRunner(simulation)
    simulation.trial.setup = TrialSetup(3, (), with_values(CONFIG, {"ball.mass_kg": 0.05}))
    simulation.reset()
    simulation.state = StateCode.PAUSED
    simulation.step(100)
    simulation.trial.setup = TrialSetup(4, (), with_values(CONFIG, {"ball.mass_kg": 0.06}))
    simulation.step(100_000)
    simulation.state = StateCode.PLAYING
    delivery = runner.hand_over()
    assert delivery is not None
    assert delivery.episode.header.trial == 3
    assert conditions_from_json(delivery.conditions).values == {"ball.mass_kg": 0.05}


def test_after_a_leased_trial_the_setup_is_the_configuration_again(simulation: Simulation) -> None:
    runner = TrialRunner(simulation)
    runner.begin(3, VALUES)
    finish(runner, simulation)
    assert simulation.trial.setup == TrialSetup(-1, (), CONFIG)


@pytest.fixture
def foreign(monkeypatch: pytest.MonkeyPatch) -> Simulation:
    """A simulation whose engine counts as one of another package."""
    monkeypatch.setattr("throwcollect.members.is_own", lambda family, _: family != "engines")
    monkeypatch.setattr("throwcollect.sim.world.load_member", lambda *_: BallisticEngine)
    return Simulation(CONFIG)


def test_a_trial_in_which_the_engine_fails_ends_with_an_error_and_the_next_one_begins(
    foreign: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("boom")

    runner = TrialRunner(foreign)
    runner.begin(0, {})
    with monkeypatch.context() as patch:
        patch.setattr(BallisticEngine, "run", fail)
        # The reset that drops the trial needs no step, as the start state is known.
        runner.advance(watched=False)
    assert not foreign.running
    with pytest.raises(MemberError, match=r"the engine ballistic of .* cannot take steps: ValueError: boom"):
        runner.hand_over()
    assert runner.hand_over() is None
    runner.begin(1, {})
    assert finish(runner, foreign).episode.header.trial == 1


def test_a_sample_of_a_wrong_step_is_an_error_of_the_engine(
    foreign: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Late(BallisticEngine):
        def run(self, steps: Steps, observer: Observer) -> int:
            return super().run(replace(steps, first_sample=steps.first_sample + 1), observer)

    runner = TrialRunner(foreign)
    runner.begin(0, {})
    monkeypatch.setattr(foreign.world.engine, "__class__", Late)
    runner.advance(watched=False)
    with pytest.raises(MemberError, match="sample 1 should be of step 2, not 3"):
        runner.hand_over()
