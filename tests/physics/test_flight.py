"""The ball's flight against integration of its equation of motion in steps of 0.1 ms."""

import numpy as np
import pytest

SECTIONS = {"sim": {"physics_hz": 1000}, "record": {"rate_hz": 1000}}


def integrate(position, velocity, seconds, *, drag_per_m=0.0, gravity=9.81, dt=1e-4):
    """Midpoint rule, whose steps are off by less than 1e-7 m in all; drag decelerates by ``drag_per_m * |v| * v``."""

    def acceleration(v):
        return np.array([0, 0, -gravity]) - drag_per_m * np.linalg.norm(v) * v

    for _ in range(round(seconds / dt)):
        middle = velocity + acceleration(velocity) * dt / 2
        position, velocity = position + middle * dt, velocity + acceleration(middle) * dt
    return position, velocity


def flight(samples, contacts):
    """Sample just after the release and sample before the landing."""
    return round(contacts[0].end_ns / 1e6) + 1, len(samples.stamps_ns) - 2


@pytest.mark.parametrize("coefficient", [0.0, 0.47, 2.0])
def test_the_flight_with_drag_matches_an_exact_integration(coefficient, thrower):
    ball = {"drag_coefficient": coefficient, "mass_kg": 0.02, "radius_m": 0.03}
    one = thrower(**SECTIONS, ball=ball)
    samples = one.throw()
    first, last = flight(samples, one.world.contacts())
    seconds = (last - first) / 1000
    area = np.pi * 0.03**2
    position, velocity = integrate(
        samples.object_position[first],
        samples.object_linear_velocity[first],
        seconds,
        drag_per_m=0.5 * 1.2 * coefficient * area / 0.02,
    )
    # Bullet's first order steps of 1 ms: g * dt * t / 2 = 3.3 mm too low after 0.67 s, less than 1 mm sideways.
    assert seconds > 0.6
    assert samples.object_position[last] - position == pytest.approx([0, 0, -9.81 * 1e-3 * seconds / 2], abs=1e-3)
    assert samples.object_linear_velocity[last] == pytest.approx(velocity, abs=5e-3)


def test_without_drag_horizontal_velocity_and_spin_stay_constant(thrower):
    one = thrower(**SECTIONS)
    samples = one.throw()
    first, last = flight(samples, one.world.contacts())
    assert np.ptp(samples.object_linear_velocity[first : last + 1, :2], axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert np.ptp(samples.object_angular_velocity[first : last + 1], axis=0) == pytest.approx([0, 0, 0], abs=1e-9)


def test_a_ball_with_drag_flies_farther_in_thinner_air(thrower):
    reach = [
        thrower(ball={"drag_coefficient": 0.5}, scene={"air_density_kgpm3": density}).throw().object_position[-1, 0]
        for density in (0.0, 1.2, 5.0)
    ]
    assert reach == sorted(reach, reverse=True)
    assert reach[0] - reach[-1] > 0.05
