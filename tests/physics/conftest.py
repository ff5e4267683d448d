import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.description import start_posture
from throwcollect.sim.world import World


class Thrower:
    """Throws along minimum-jerk motions and remembers the world it threw in."""

    def __init__(self, config):
        self.config = config
        self.world = World(config)

    def throw(self, config=None, *, duration=1.0, gamma=1.2, **end):
        config = config or self.config
        moving = self.world.moving
        hz = config.sim.physics_hz
        x = np.minimum(np.arange(1, round(config.sim.max_trial_s * hz) + 1) / hz / duration, 1) ** gamma
        start = start_posture(config)
        goal = {**start, **config.task.end, **end}
        path = np.array([[start[j], goal[j] - start[j]] for j in moving]).T
        self.world.reset(config)
        self.world.run((path[0] + (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None] * path[1]).tolist())
        return self.world.samples()


@pytest.fixture
def thrower():
    """Makes throwers from configuration sections and closes their worlds at the end."""
    made = []

    def make(**sections):
        made.append(Thrower(Config.model_validate(sections)))
        return made[-1]

    yield make
    for one in made:
        one.world.close()


@pytest.fixture
def landing():
    """Point and time of a landing: where the ball's lowest point crosses the ground, between two samples."""

    def find(samples, radius=0.025):
        lowest = samples.object_position[-2:, 2] - radius
        share = lowest[0] / (lowest[0] - lowest[1])
        before, after = samples.object_position[-2:]
        times = samples.stamps_ns[-2:] / 1e9
        return (before + share * (after - before))[:2], float(times[0] + share * (times[1] - times[0]))

    return find
