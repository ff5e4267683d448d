"""Random but plausible episodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from throwcollect.episode.record import Contact, ControllerSamples, EpisodeHeader, GoalOutcome, Samples
from throwcollect.robots.talos import TALOS

MakeSamples = Callable[..., Samples]


def random_samples(count: int = 50, *, seed: int = 0, start_ns: int = 10**10) -> Samples:
    random = np.random.default_rng(seed)
    quaternion = random.normal(size=(count, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, np.newaxis]
    joints = [random.normal(size=(count, len(TALOS.joints))) for _ in range(3)]
    position, linear, angular = (random.normal(size=(count, 3)) for _ in range(3))
    stamps = start_ns + 4_000_000 * np.arange(count, dtype=np.int64)
    return Samples(stamps, *joints, position, quaternion, linear, angular)


def random_set_points(controller: str, count: int, *, seed: int = 1) -> ControllerSamples:
    random = np.random.default_rng(seed)
    shape = (count, len(TALOS.controllers[controller]))
    elapsed = 4_000_000 * np.arange(count, dtype=np.int64)
    return ControllerSamples(elapsed, *(random.normal(size=shape) for _ in range(4)))


@pytest.fixture(scope="session")
def make_samples() -> MakeSamples:
    return random_samples


@pytest.fixture(scope="session")
def make_set_points() -> Callable[..., ControllerSamples]:
    return random_set_points


@pytest.fixture(scope="session")
def header() -> EpisodeHeader:
    return EpisodeHeader(
        trial=7,
        start_ns=10**10,
        end_reason="landed",
        contacts=(Contact("spoon", 10**10, 10**10 + 80_000_000), Contact("ground", 10**10 + 90_000_000, None)),
        goals=(GoalOutcome("arm_right_controller", 4, 0, "Goal „reached“"),),
        samples=50,
    )
