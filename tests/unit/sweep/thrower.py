"""Throws by formula: a ballistic flight whose start depends on parameters in a way that is neither linear nor even."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from tests.unit.sweep.columns import in_columns
from tests.unit.sweep.own_plan import make_plan

from throwcollect.config.schema import Config
from throwcollect.sweep.plan import make_trials
from throwcollect.sweep.rounds import Rounds
from throwcollect.sweep.trials import Trial
from throwcollect.tasks.measures import BallState
from throwcollect.tasks.throw.throw_result import ThrowOutcome, ThrowResult

PARAMETERS = {
    "task.duration_s": {"min": 0.5, "max": 2.0},
    "task.trajectory.gamma": {"min": 0.67, "max": 2.0},
    "ball.mass_kg": {"min": 0.01, "max": 1.0, "scale": "log"},
    "ball.friction": {"min": 0.0, "max": 1.0},
    "scene.landing_height_m": {"min": 0.0, "max": 0.5},
}
DISTANCE = {"min": 0.5, "max": 2.4, "bins": 12}
HIT_ANGLE = {"min": 0.9, "max": 1.5, "bins": 8}
TARGET = {"distance_m": DISTANCE, "hit_angle_rad": HIT_ANGLE}

Throw = Callable[[Trial], ThrowResult]


def configuration(
    *, trials: int | None = 640, target: dict[str, Any] | None = TARGET, landed: int | None = None, **sweep: Any
) -> Config:
    parts: dict[str, Any] = {"parameters": PARAMETERS, **sweep}
    if target is not None:
        parts["target"] = target
    until = None if landed is None else {"landed": landed}
    return Config.model_validate({"seed": 1, "trials": trials, "until": until, "sweep": parts})


def throw(trial: Trial) -> ThrowResult:
    duration, gamma, mass, friction, height = (trial.values[key] for key in PARAMETERS)
    swing, late, heavy = (duration - 0.5) / 1.5, (gamma - 0.67) / 1.33, math.log10(mass) / 2 + 1
    if (swing < 0.25 and heavy > 0.6) or late + friction > 1.8:
        return ThrowResult(ThrowOutcome.SELF_HIT)
    speed = 1 + 3 * swing**1.5 * (0.6 + 0.4 * late)
    elevation = 0.9 - 1.3 * heavy * friction + 0.3 * math.sin(3 * swing)
    level, up = speed * math.cos(elevation), speed * math.sin(elevation)
    time = (up + math.sqrt(up**2 + 2 * 9.81 * (1.3 - height))) / 9.81
    landing = BallState(time, (0.6 * level * time, -0.8 * level * time, height), (level, 0.0, up - 9.81 * time))
    return ThrowResult(ThrowOutcome.LANDED, landing=landing, hit_angle_rad=math.atan2(9.81 * time - up, level))


def go_on(
    config: Config,
    trials: list[Trial],
    *,
    throw: Throw = throw,
    order: Callable[[list[Trial]], Iterable[Trial]] = list,
    rounds: int | None = None,
) -> list[Trial]:
    """The trials of a collection that goes on from a plan, of which nothing has been run.

    Args:
        config: Its configuration.
        trials: The trials that the plan has; it gets those that are added.
        throw: What comes of a trial.
        order: The order in which trials end that are run at the same time.
        rounds: Rounds after which it is left.
    """
    grown = Rounds(config)
    grown.add(in_columns(trials[:128]))
    ended = 0
    while True:
        for trial in order(trials[ended : grown.planned]):
            grown.take_result(trial.number, throw(trial))
        ended = grown.planned
        if grown.over or (rounds is not None and ended >= 64 * rounds):
            return trials
        added = make_trials(config, grown.draw(), first=ended)
        there = trials[ended : ended + len(added)]
        assert there == list(added)[: len(there)], "a round that the plan has already is drawn again the same"
        trials += added[len(there) :]
        grown.add(added)


def collect(config: Config, **options: Any) -> list[Trial]:
    return go_on(config, list(make_plan(config).trials), **options)
