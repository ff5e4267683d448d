"""Synthetic throws in closed form: a ball that rides along, leaves on a parabola and crosses a plane."""

from __future__ import annotations

import numpy as np

from throwcollect.config.schema import Config
from throwcollect.episode.record import Contact, EpisodeHeader, GoalOutcome, Samples
from throwcollect.robots.talos import TALOS
from throwcollect.robots.trajectory import sample_quintic
from throwcollect.tasks.task import task_of

START_NS = 7_000_000_000
RELEASE_S = 0.6373
ORIGIN = np.array([0.145, -0.16, 2.25])
VELOCITY = np.array([2.18, -0.16, 0.34])
GRAVITY = 9.81


def parabola(times: np.ndarray, origin=ORIGIN, velocity=VELOCITY) -> tuple[np.ndarray, np.ndarray]:
    """Ball before (at rest where it will be released) and after its release."""
    flown = np.clip(times - RELEASE_S, 0, None)[:, None]
    g = np.array([0, 0, -GRAVITY])
    moving = (times >= RELEASE_S)[:, None]
    return origin + velocity * flown + g * flown**2 / 2, np.where(moving, velocity + g * flown, velocity)


def landing_time(height: float, origin=ORIGIN, velocity=VELOCITY) -> float:
    drop = origin[2] - height
    return RELEASE_S + (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * GRAVITY * drop)) / GRAVITY


def episode(
    config: Config | None = None,
    *,
    contacts: tuple[tuple[str, float, float | None], ...] = (("spoon", 0.0, RELEASE_S),),
    duration_s: float = 1.4,
    goals: tuple[GoalOutcome, ...] = (),
    end_reason: str = "landed",
    rate_hz: int = 250,
    **ball,
) -> tuple[Samples, EpisodeHeader]:
    config = config or Config()
    count = round(duration_s * rate_hz) + 1
    stamps = START_NS + np.arange(count) * (1_000_000_000 // rate_hz)
    times = (stamps - START_NS) / 1e9
    trajectory = task_of(config).trajectory()
    position = np.tile([{**TALOS.rest_posture, **config.task.start}[joint] for joint in TALOS.joints], (count, 1))
    velocity = np.zeros((count, 32))
    columns = [TALOS.joints.index(joint) for joint in trajectory.joints]
    position[:, columns], velocity[:, columns], _ = sample_quintic(trajectory, times)
    object_position, ball_velocity = parabola(times, **ball)
    samples = Samples(
        stamps_ns=stamps,
        position=position,
        velocity=velocity,
        effort=np.zeros((count, 32)),
        object_position=object_position,
        object_orientation_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        object_linear_velocity=ball_velocity,
        object_angular_velocity=np.zeros((count, 3)),
    )

    def stamp(time: float) -> int:
        return START_NS + round(time * 1e9)

    header = EpisodeHeader(
        trial=6,
        start_ns=START_NS,
        end_reason=end_reason,
        contacts=tuple(Contact(b, stamp(s), None if e is None else stamp(e)) for b, s, e in contacts),
        goals=goals,
        samples=count,
    )
    return samples, header
