"""Mistakes of an engine of another package are found where they are made, and the message names the package."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.ballistic.ballistic_engine import BallisticEngine
from throwcollect.engines.engine import Observer, Sample, State, Steps
from throwcollect.errors import MemberError
from throwcollect.replay.replayer import Replayer
from throwcollect.sim.simulation import Simulation
from throwcollect.sim.trial_runner import TrialRunner
from throwcollect.sweep.trials import Trial

CONFIG = Config.model_validate({"sim": {"engine": "ballistic"}})
TRIAL = Trial(0, {}, 0, "")


class Wrong(BallisticEngine):
    """A right engine; tests give it mistakes."""


def fail(*_: Any) -> None:
    raise ValueError("boom")


def exit_silently(*_: Any) -> None:
    raise SystemExit(0)


class ToldWrong(Observer):
    """Changes what an engine tells of its steps."""

    def __init__(self, observer: Observer, touch: Callable[..., Any] | None, sample: Callable[..., Any] | None) -> None:
        self._observer, self._touch, self._sample = observer, touch, sample

    def on_touch(self, step: int, bodies: frozenset[str]) -> None:
        step, bodies = self._touch(step, bodies) if self._touch else (step, bodies)
        self._observer.on_touch(step, bodies)

    def on_sample(self, step: int, sample: Sample) -> bool:
        told = self._sample(step, sample) if self._sample else [(step, sample)]
        # All are told, also behind one that stops the engine.
        answers = [self._observer.on_sample(*each) for each in told]
        return any(answers)


def tell(
    *, touch: Callable[..., Any] | None = None, sample: Callable[..., Any] | None = None, stops: bool = True
) -> Callable[..., int]:
    """Make a method `run` that tells other touches and samples than there are, and may go on when it is stopped."""

    def run(engine: BallisticEngine, steps: Steps, observer: Observer) -> int:
        told = ToldWrong(observer, touch, sample)
        if not stops:
            heard = told.on_sample
            told.on_sample = lambda step, row: bool(heard(step, row)) and False  # type: ignore[method-assign]
        return BallisticEngine.run(engine, steps, told)

    return run


def change_result(change: Callable[[int], Any]) -> Callable[..., Any]:
    return lambda *arguments: change(BallisticEngine.run(*arguments))


def change_state(**changes: Any) -> property:
    right: Callable[[Any], State] = BallisticEngine.state.fget  # type: ignore[attr-defined]
    return property(lambda engine: replace(right(engine), **changes))


def change_sample(change: Callable[[Sample], Any]) -> Callable[..., Any]:
    return lambda engine: change(BallisticEngine._sample(engine))


@pytest.fixture(autouse=True)
def _another_package(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("throwcollect.sim.checked_engine", "throwcollect.members"):
        monkeypatch.setattr(f"{module}.is_own", lambda family, _: family != "engines")
    monkeypatch.setattr("throwcollect.sim.checked_engine.load_member", lambda *_: Wrong)


def throw() -> Any:
    replayer = Replayer(CONFIG)
    try:
        return replayer.run(TRIAL)
    finally:
        replayer.close()


def test_a_right_engine_of_another_package_makes_the_same_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    checked = throw()
    monkeypatch.undo()
    assert checked.digest == throw().digest


@pytest.mark.parametrize(
    ("method", "value", "said"),
    [
        ("__init__", fail, "be made: ValueError: boom"),
        ("load", exit_silently, "carry out load: SystemExit: 0"),
        ("configure", lambda *_: {}["hz"], "carry out configure: KeyError: 'hz'"),
        ("rest", fail, "carry out rest: ValueError: boom"),
        ("run", fail, "carry out run: ValueError: boom"),
        ("run", lambda *_: 0, "carry out run: ValueError: run should return the number of steps taken, 25, returns 0"),
        ("run", change_result(float), "carry out run: TypeError: what run returns: should be a valid integer, is 25.0"),
        ("run", change_result(lambda taken: taken + 1), "the number of steps taken, 25, returns 26"),
        ("run", tell(sample=lambda *_: []), "ValueError: on_sample should be called for step 1 of 249, is not"),
        (
            "run",
            tell(sample=lambda step, row: [(step, row)] * 2),
            "on_sample should be called for step 3, is called for 1",
        ),
        (
            "run",
            tell(sample=lambda step, row: [(step - 1, row)]),
            "on_sample should be called for step 1, is called for 0",
        ),
        ("run", tell(sample=lambda step, row: [(float(step), row)]), "on_sample: step: should be a valid integer"),
        ("run", tell(sample=lambda step, row: [(step, [*row])]), "on_sample: sample: should be a valid tuple, is ["),
        ("run", tell(stops=False), "is the last one"),
        ("run", tell(touch=lambda step, _: (step, "spoon")), "on_touch: bodies: should be a valid frozenset, is 'spoo"),
        (
            "run",
            tell(touch=lambda step, _: (step, frozenset({"moon"}))),
            "'moon' touches the ball, but there is no suc",
        ),
        ("run", tell(touch=lambda step, bodies: (-step, bodies)), "ValueError: on_touch is called for step -"),
        ("state", None, "what state returns: should be an instance of State, is None"),
        ("state", change_state(touching=frozenset({"cup"})), "'cup' touches the ball, but there is no such tool"),
        ("state", change_state(sample=(0.0,)), "ValueError: a sample should have 28 numbers, has 1"),
        ("_sample", change_sample(lambda row: row[:-1]), "ValueError: a sample should have 28 numbers, has 27"),
        ("_sample", change_sample(list), "sample: should be a valid tuple, is ["),
        ("_sample", change_sample(lambda row: (math.nan, *row[1:])), "sample.0: should be a finite number, is nan"),
        (
            "_sample",
            change_sample(lambda row: (*row[:-10], 0.0, 0.0, 0.0, 0.0, *row[-6:])),
            "the orientation of the ball in a sample should have the length 1, has 0",
        ),
    ],
)
def test_a_mistake_of_an_engine_of_another_package_is_an_error_that_says_what_would_be_right(
    method: str, value: Any, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Wrong, method, value, raising=False)
    with pytest.raises(MemberError) as caught:
        throw()
    assert str(caught.value).startswith("the engine ballistic of ")
    assert said in str(caught.value)


def test_a_trial_in_which_the_engine_fails_ends_with_an_error_and_the_next_one_begins(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = Simulation(CONFIG)
    runner = TrialRunner(simulation)
    runner.begin(0, {})
    monkeypatch.setattr(Wrong, "run", fail)
    # The reset that drops the trial needs no step, as the start state is known.
    runner.advance(watched=False)
    monkeypatch.undo()
    assert not simulation.running
    with pytest.raises(MemberError, match="cannot carry out run: ValueError: boom"):
        runner.hand_over()
    assert runner.hand_over() is None
    runner.begin(1, {})
    while (delivery := runner.hand_over()) is None:
        runner.advance(watched=False)
    assert delivery.episode.header.trial == 1


def test_a_failure_outside_of_trials_is_an_error_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = Simulation(CONFIG)
    runner = TrialRunner(simulation)
    monkeypatch.setattr(Wrong, "run", fail)
    with pytest.raises(MemberError, match="cannot carry out run: ValueError: boom"):
        runner.advance(watched=False)
