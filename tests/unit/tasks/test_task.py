from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pytest

from throwcollect.config.schema import Config
from throwcollect.episode.record import EpisodeHeader, Samples
from throwcollect.errors import ConfigError
from throwcollect.replay.replayer import Replayer
from throwcollect.robots.talos import TALOS
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.result import Outcome
from throwcollect.tasks.result_columns import Count, Number, measured
from throwcollect.tasks.task import task_of
from throwcollect.tasks.throw.throw_config import ThrowConfig
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult
from throwcollect.tasks.throw.throw_task import ThrowTask


def test_a_trajectory_has_the_moving_joints_in_the_order_of_the_robot():
    points = task_of(Config()).trajectory()
    assert set(points.joints) == set(Config().task.end)
    assert list(points.joints) == [joint for joint in TALOS.joints if joint in points.joints]
    assert points.positions.shape == points.velocities.shape == points.accelerations.shape == (26, 5)


def test_each_column_goes_from_the_start_to_the_end_of_its_joint():
    task = Config().task
    points = task_of(Config()).trajectory()
    assert points.positions[0].tolist() == [task.start[joint] for joint in points.joints]
    assert points.positions[-1].tolist() == [task.end[joint] for joint in points.joints]


def test_the_family_of_the_configuration_shapes_the_trajectory():
    config = Config(task={"trajectory": {"family": "dmp"}, "duration_s": 2.0})
    points = task_of(config).trajectory()
    assert points.positions[-1].tolist() == [config.task.end[joint] for joint in points.joints]
    assert points.accelerations[0].any()


def test_motion_that_cannot_be_computed_is_refused():
    weights = {"arm_right_4_joint": [1e6] * 20}
    with pytest.raises(ConfigError, match="settle"):
        task_of(Config(task={"trajectory": {"family": "dmp", "weights": weights}})).trajectory()


@dataclass(frozen=True)
class _CountedResult(ThrowResult):
    bounces: int | None = measured(Count("How often the ball bounced."))
    surface: str | None = measured(Number("Declared as a number by mistake."))


def _judge_of_another_package(monkeypatch: pytest.MonkeyPatch, **values: Any) -> _CountedResult:
    class Counted(ThrowTask):
        results = _CountedResult

        def assess(self, result: Any, samples: Samples, header: EpisodeHeader) -> Any:
            return replace(result, **values), None

    monkeypatch.setattr("throwcollect.tasks.task.is_own", lambda *_: False)
    replayer = Replayer(config := Config.model_validate({"sim": {"engine": "ballistic"}}))
    episode = replayer.run(Trial(0, {}, 0, ""))
    replayer.close()
    task = Counted(config)
    judged: _CountedResult = task.judge(episode.samples(TALOS.joints), episode.header, task.trajectory())
    return judged


def test_a_result_of_another_package_that_the_table_cannot_hold_is_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert _judge_of_another_package(monkeypatch, bounces=2**63 - 1).bounces == 2**63 - 1
    with pytest.raises(ValueError, match=f"result.bounces: should be from -2\\^63 to 2\\^63 - 1, is {2**63}"):
        _judge_of_another_package(monkeypatch, bounces=2**63)
    with pytest.raises(TypeError, match=r"^its result\.surface: should be a valid number, is 'sand'$"):
        _judge_of_another_package(monkeypatch, surface="sand")
    with pytest.raises(ValueError, match="surrogates not allowed"):
        _judge_of_another_package(monkeypatch, reason="\ud800")


def test_a_section_of_another_package_with_a_wrong_noun_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("throwcollect.tasks.task.is_own", lambda *_: False)
    assert task_of(Config()).config == Config()
    monkeypatch.setattr(ThrowConfig, "noun", property(lambda _: None))
    with pytest.raises(TypeError, match=r"^noun: should be a valid string, is None$"):
        task_of(Config())


def test_outcomes_of_trials_without_an_episode_are_not_for_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(TypeError, match=r"^its outcome: should be another than lost, which is for trials without"):
        _judge_of_another_package(monkeypatch, outcome=ThrowOutcome.LOST)
    own = {each.name: each.value for each in ThrowOutcome}
    monkeypatch.setattr(ThrowTask, "outcomes", Outcome("Outcomes", {**own, "REFUSED": "refused"}))
    with pytest.raises(
        TypeError, match=r"^outcomes: should not have refused, which is for trials that the plan refuses$"
    ):
        task_of(Config())
