from __future__ import annotations

import numpy as np
import pytest

from throwcollect.config.schema import Config, DynamicMovementPrimitive
from throwcollect.errors import ConfigError
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.dmp import basis, dmp_trajectory, fit_motions, roll_out
from throwcollect.tasks.task import task_of

ELBOW = "arm_right_4_joint"
PLAIN = DynamicMovementPrimitive(family="dmp")


def roll(times, *, weights, family=PLAIN, tau=0.8):
    start, goal = np.array([-1.9, 0.2]), np.array([-0.5, 0.2])
    return roll_out(times, start=start, goal=goal, weights=weights, tau=tau, family=family)


def test_without_weights_a_dmp_is_a_critically_damped_spring():
    times = np.linspace(0, 1, 51)
    positions, velocities, accelerations = roll(times, weights=np.zeros((2, 20)))
    rate = 48 / 2 / 0.8
    decay = np.exp(-rate * times)
    assert positions[:, 0] == pytest.approx(-0.5 - 1.4 * (1 + rate * times) * decay, abs=1e-6)
    assert velocities[:, 0] == pytest.approx(1.4 * rate**2 * times * decay, abs=5e-5)
    assert accelerations[:, 0] == pytest.approx(1.4 * rate**2 * (1 - rate * times) * decay, abs=5e-3)
    assert (positions[:, 1] == 0.2).all()


@pytest.mark.parametrize("alpha_z", [10.0, 48.0, 200.0])
@pytest.mark.parametrize(("count", "tau"), [(2, 0.1), (100, 3.0)])
def test_a_finer_step_does_not_move_the_curve(count, tau, alpha_z):
    family = DynamicMovementPrimitive(family="dmp", basis_functions=count, alpha_z=alpha_z)
    # Weights that bend the path by about a radian.
    weights = np.random.default_rng(count).uniform(-1, 1, (2, count)) * alpha_z**2 / 4
    times = np.linspace(0, 1.5 * tau, 31)
    coarse = roll(times, weights=weights, family=family, tau=tau)[0]
    # Between two times there are up to 120 steps; where times are closer than a step, there is one.
    fine = roll(np.linspace(0, 1.5 * tau, 30 * 240 + 1), weights=weights, family=family, tau=tau)[0][::240]
    scale = np.ptp(fine)
    assert np.abs(coarse - fine).max() < 2e-6 * scale


def test_error_falls_with_the_fourth_power_of_the_step():
    weights = np.random.default_rng(3).uniform(-500, 500, (2, 20))
    # These times are so close that there is one step between two of them.
    coarse, fine, exact = (roll(np.linspace(0, 1, 400 * n + 1), weights=weights)[0][::n] for n in (1, 2, 16))
    errors = [np.abs(each - exact).max() for each in (coarse, fine)]
    assert 10 < errors[0] / errors[1] < 25


def test_velocity_and_acceleration_are_derivatives_of_the_path():
    weights = np.random.default_rng(1).uniform(-300, 300, (2, 20))
    times = np.linspace(0, 1, 4001)
    positions, velocities, accelerations = roll(times, weights=weights)
    assert np.gradient(positions, times, axis=0)[1:-1] == pytest.approx(velocities[1:-1], abs=1e-3)
    assert np.gradient(velocities, times, axis=0)[1:-1] == pytest.approx(accelerations[1:-1], abs=0.05)


def test_basis_functions_sum_to_the_phase_everywhere():
    phase = np.exp(-2.0 * np.linspace(0, 20, 300))
    values = basis(phase, count=20, alpha_x=2.0)
    assert np.isfinite(values).all()
    assert values.sum(axis=1) == pytest.approx(phase, rel=1e-12)
    centres = np.exp(-2.0 * np.linspace(0, 1, 20))
    assert basis(centres, count=20, alpha_x=2.0).argmax(axis=1).tolist() == list(range(20))


@pytest.mark.parametrize(
    ("count", "gamma", "bound"), [(10, 1.2, 2e-3), (20, 1.2, 5e-4), (40, 1.2, 1.5e-4), (20, 0.95, 5e-4)]
)
def test_fitted_weights_repeat_the_demonstrated_motion(count, gamma, bound):
    motion = task_of(Config(task={"trajectory": {"family": "minimum_jerk", "gamma": gamma}})).trajectory()
    times = np.linspace(0, 1, 401)
    positions, velocities, _ = sample_quintic(motion, times)
    (family,) = fit_motions([motion], basis_functions=count)
    config = Config(task={"trajectory": family.model_dump()})
    curve, speed, _ = sample_quintic(task_of(config).trajectory(), times)
    assert np.abs(curve - positions).max() < bound
    assert np.abs(speed - velocities).max() < 50 * bound
    assert family.basis_functions == count


def test_trajectory_ends_at_rest_at_the_goal_after_a_short_approach():
    points = dmp_trajectory({ELBOW: -1.9}, {ELBOW: -0.5}, duration_s=1.0, family=PLAIN, points_hz=50)
    assert points.positions[-1].tolist() == [-0.5]
    assert points.velocities[-1].tolist() == points.accelerations[-1].tolist() == [0.0]
    assert abs(points.positions[-2, 0] + 0.5) < 1e-3
    assert abs(points.velocities[-2, 0]) < 5e-3
    assert points.times[-1] - points.times[-2] == pytest.approx(0.2)
    _, _, accelerations = sample_quintic(points, np.linspace(points.times[-2], points.times[-1], 100))
    assert np.abs(accelerations[1:]).max() < 0.5
    assert points.times[-1] < 1.0


def test_joint_that_is_at_its_goal_already_stays():
    points = dmp_trajectory({ELBOW: 0.4}, {ELBOW: 0.4}, duration_s=1.0, family=PLAIN, points_hz=50)
    assert points.times == pytest.approx([0.0, 0.2])
    assert points.positions == pytest.approx(0.4)


def test_joint_can_move_and_return_to_its_start():
    family = DynamicMovementPrimitive(family="dmp", weights={ELBOW: [0.0] * 5 + [300.0] * 8 + [0.0] * 7})
    points = dmp_trajectory({ELBOW: 0.4}, {ELBOW: 0.4}, duration_s=1.0, family=family, points_hz=50)
    assert np.abs(points.positions - 0.4).max() > 0.1


def test_motion_that_does_not_settle_is_refused():
    family = DynamicMovementPrimitive(family="dmp", alpha_x=0.1, weights={ELBOW: [100.0] * 20})
    with pytest.raises(
        ConfigError, match=r"the DMP of arm_right_4_joint has not settled after 5\.\d+ s: it is 0\.11 rad from its goal"
    ):
        dmp_trajectory({ELBOW: 0.0}, {ELBOW: 1.0}, duration_s=1.0, family=family, points_hz=50)
