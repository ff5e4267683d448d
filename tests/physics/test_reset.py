"""The start state of a trial does not depend on what was simulated before, to the last bit."""

import hashlib
import random
from dataclasses import fields

import pytest

from throwcollect.config.schema import Config

TRIALS = 8
DEFAULT = Config()


def draw(rng):
    """A trial that differs from the default in about half of its parameters, and a motion; many are no clean throws."""

    def some(**ranges):
        return {key: rng.uniform(*bounds) for key, bounds in ranges.items() if rng.random() < 0.5}

    start = some(arm_right_4_joint=(-2.1, -1.6), torso_1_joint=(-0.5, 0.5), arm_right_7_joint=(-0.3, 0.3))
    config = Config.model_validate(
        {
            "ball": some(
                mass_kg=(0.02, 0.2),
                radius_m=(0.015, 0.04),
                friction=(0, 1),
                restitution=(0, 1),
                drag_coefficient=(0, 1),
            ),
            "scene": some(gravity_mps2=(5, 15), spoon_friction=(0, 1)) | some(landing_height_m=(0.5, 1.5)),
            "robot": some(position_gain_per_s=(20, 200), velocity_gain=(0.5, 1), effort_scale=(0.5, 2)),
            "sim": {"max_trial_s": 3, **some(command_delay_s=(0, 0.05))},
            "task": {"start": {**DEFAULT.task.start, **start}},
        }
    )
    motion = {
        "duration": rng.uniform(0.5, 1.4),
        "gamma": rng.uniform(0.9, 1.4),
        "arm_right_4_joint": rng.uniform(-1.5, -0.2),
        "arm_right_7_joint": rng.uniform(-0.3, 0.6),
        "torso_1_joint": rng.uniform(-0.3, 0.3),
    }
    return config, motion


def digest(thrower, trial):
    config, motion = trial
    samples = thrower.throw(config, **motion)
    sha = hashlib.sha256(repr((thrower.world.contacts(), thrower.world.end_reason)).encode())
    for field in fields(samples):
        sha.update(getattr(samples, field.name).tobytes())
    return sha.hexdigest()


@pytest.fixture(scope="module")
def trials():
    rng = random.Random(5)
    return [draw(rng) for _ in range(TRIALS)]


def test_mixed_trials_in_any_order_equal_the_same_trials_in_a_new_world(trials, thrower):
    alone, bodies = [], set()
    for config, motion in trials:
        one = thrower(**config.model_dump())
        alone.append(digest(one, (config, motion)))
        bodies |= {contact.body for contact in one.world.contacts()}
    assert len(set(alone)) == TRIALS
    assert len(bodies) > 2, "without contacts with the robot the order of contacts is not put to the test"

    rng = random.Random(6)
    one = thrower()
    # Some trials come several times in a row: they then start from the kept state of the trial before.
    order = [number for number in range(TRIALS) for _ in range(rng.choice([1, 1, 3]))]
    rng.shuffle(order)
    for number in [*order, *range(TRIALS)]:
        assert digest(one, trials[number]) == alone[number], f"trial {number} depends on what was before"


def test_trials_with_another_tool_or_posture_leave_no_trace(trials, thrower):
    one = thrower()
    before = digest(one, trials[0])
    one.throw(Config.model_validate({"tool": {"cup_walls": 8}, "robot": {"posture": {"torso_2_joint": 0.1}}}))
    one.throw(Config.model_validate({"sim": {"physics_hz": 250, "solver_iterations": 10}}))
    assert digest(one, trials[0]) == before
