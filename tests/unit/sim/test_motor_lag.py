"""Motors that lag behind their commands."""

import math

import numpy as np
import pytest

from throwcollect.sim.motors import lag_behind


def test_a_motor_has_gone_63_percent_of_a_step_after_its_time_constant() -> None:
    reached = lag_behind(np.ones((500, 1)), np.zeros(1), hz=500.0, lag_s=0.02)
    assert reached[9, 0] == pytest.approx(1 - math.exp(-1))
    assert reached[-1, 0] == pytest.approx(1.0)
    assert (np.diff(reached[:50, 0]) > 0).all()


def test_a_lagging_motor_continues_from_its_last_position() -> None:
    commands = np.random.default_rng(0).random((40, 3))
    whole = lag_behind(commands, np.zeros(3), hz=500.0, lag_s=0.01)
    first = lag_behind(commands[:15], np.zeros(3), hz=500.0, lag_s=0.01)
    rest = lag_behind(commands[15:], first[-1], hz=500.0, lag_s=0.01)
    assert np.array_equal(np.concatenate([first, rest]), whole)


def test_a_lagging_motor_follows_a_ramp_late_by_its_time_constant() -> None:
    ramp = np.arange(1, 1001)[:, np.newaxis] / 500.0
    reached = lag_behind(ramp, np.zeros(1), hz=500.0, lag_s=0.05)
    assert ramp[-1, 0] - reached[-1, 0] == pytest.approx(0.05, abs=0.002)
