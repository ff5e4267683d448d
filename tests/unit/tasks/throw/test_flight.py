from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact
from throwcollect.tasks.free_flight import ballistic_positions
from throwcollect.tasks.throw.flight import flight_residual

from .episodes import RELEASE_S, episode

DRAG = Config(ball={"drag_coefficient": 0.47})
RELEASED = 160  # first sample at or after the release


def discrete_throw(config):
    """An episode whose flight is stepped in numpy, independently of the code under test."""
    samples, header = episode(config)
    dt = 1 / config.sim.physics_hz
    scene, ball = config.scene, config.ball
    factor = scene.air_density_kgpm3 * ball.drag_coefficient * math.pi * ball.radius_m**2 / 2 / ball.mass_kg
    x, v = samples.object_position[RELEASED].copy(), samples.object_linear_velocity[RELEASED].copy()
    for row in range(RELEASED + 1, len(samples.stamps_ns)):
        for _ in range(config.sim.physics_hz // config.record.rate_hz):
            v = v + (np.array([0, 0, -scene.gravity_mps2]) - factor * np.linalg.norm(v) * v) * dt
            x = x + v * dt
        samples.object_position[row], samples.object_linear_velocity[row] = x, v
    return samples, header


@pytest.mark.parametrize("config", [Config(), DRAG, Config(scene={"gravity_mps2": 1.62})])
def test_a_flight_in_steps_of_the_physics_has_no_residual(config):
    assert math.ceil(RELEASE_S * 250) == RELEASED
    samples, header = discrete_throw(config)
    assert flight_residual(samples, header, config=config) < 1e-12


def test_wrong_gravity_or_forgotten_drag_gives_a_residual():
    samples, header = discrete_throw(DRAG)
    assert 1e-3 < flight_residual(samples, header, config=Config()) < 0.1
    samples, header = discrete_throw(Config())
    assert flight_residual(samples, header, config=Config(scene={"gravity_mps2": 9.80665})) > 1e-4


def test_a_displaced_sample_gives_its_distance_as_residual():
    samples, header = discrete_throw(Config())
    samples.object_position[250] += [0, 3e-6, 4e-6]
    assert flight_residual(samples, header, config=Config()) == pytest.approx(5e-6, rel=1e-6)


def test_flight_ends_with_the_first_contact():
    samples, header = discrete_throw(Config())
    samples.object_position[251:] += 0.1
    contact = Contact("ground", int(samples.stamps_ns[251]), None)
    assert flight_residual(samples, header, config=Config()) > 0.1
    touched = replace(header, contacts=(*header.contacts, contact))
    assert flight_residual(samples, touched, config=Config()) < 1e-12


def test_the_residual_counts_only_samples_after_the_recatch_gap():
    samples, header = discrete_throw(Config())
    free = math.ceil((RELEASE_S + Config().task.recatch_gap_s) * 250)
    samples.object_position[:free] += 0.1
    assert flight_residual(samples, header, config=Config()) < 1e-12
    samples.object_position[free] += 0.1
    assert flight_residual(samples, header, config=Config()) > 0.05


def test_a_throw_without_a_flight_has_no_residual():
    samples, header = episode(contacts=(("spoon", 0.0, None),))
    assert flight_residual(samples, header, config=Config()) is None
    samples, header = episode(contacts=(("spoon", 0.0, 1.4),))
    assert flight_residual(samples, header, config=Config()) is None


def test_ballistic_motion_converges_to_the_parabola_with_the_physics_rate():
    start, velocity = np.array([0.0, 0.0, 2.0]), np.array([2.0, 0.0, 0.5])
    exact = start + velocity * 0.5 + np.array([0, 0, -9.81]) * 0.5**2 / 2
    errors = []
    for hz in (250, 500, 1000):
        config = Config(sim={"physics_hz": hz}, record={"rate_hz": 250})
        errors.append(np.linalg.norm(ballistic_positions(start, velocity, steps=hz // 2, config=config)[-1] - exact))
    assert errors[0] / errors[1] == pytest.approx(2, rel=1e-6)
    assert errors[1] / errors[2] == pytest.approx(2, rel=1e-6)


@pytest.mark.parametrize("drag", [0.0, 0.47])
def test_ballistic_motion_is_the_sum_of_its_steps_bit_for_bit(drag):
    config = Config(ball={"drag_coefficient": drag}, sim={"physics_hz": 1000})
    per_m = 0.5 * 1.2 * drag * (math.pi * 0.025**2) / 0.045
    position, velocity = [0.3, -0.2, 1.1], [1.9, 0.4, 2.3]
    expected = [list(position)]
    for _ in range(700):
        braking = per_m * math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2])
        for axis, gravity in enumerate((0.0, 0.0, 9.81)):
            velocity[axis] -= (gravity + braking * velocity[axis]) * (1 / 1000)
            position[axis] += velocity[axis] * (1 / 1000)
        expected.append(list(position))
    path = ballistic_positions(np.array(expected[0]), np.array([1.9, 0.4, 2.3]), steps=700, config=config)
    assert path.tolist() == expected


def test_drag_slows_the_ball_towards_its_terminal_speed():
    config = Config(ball={"drag_coefficient": 0.47})
    path = ballistic_positions(np.zeros(3), np.zeros(3), steps=20_000, config=config)
    terminal = math.sqrt(2 * 0.045 * 9.81 / (1.2 * 0.47 * math.pi * 0.025**2))
    assert (path[-2] - path[-1])[2] * 500 == pytest.approx(terminal, rel=1e-6)
