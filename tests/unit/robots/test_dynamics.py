import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.robots.description import start_posture
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.robot import joint_limits
from throwcollect.robots.talos import TALOS


def test_the_velocity_of_the_tool_agrees_with_finite_differences():
    draw, limits, spoon = (
        np.random.default_rng(3),
        joint_limits(TALOS),
        ToolMotion(Config(tool={"mount_offset_m": 0.2})),
    )
    for _ in range(5):
        position, velocity = draw.uniform(limits.lower, limits.upper), draw.uniform(-1, 1, 32)
        before, after = (spoon.place(position + sign * 1e-6 * velocity) for sign in (-1, 1))
        assert spoon.velocity(position, velocity) == pytest.approx((after - before) / 2e-6, abs=1e-7)


def test_the_tool_rises_with_the_height_of_the_base():
    posture = np.array(list(start_posture(Config()).values()))
    low, high = (ToolMotion(Config(robot={"base_height_m": height})).place(posture) for height in (0.6, 1.1))
    assert high - low == pytest.approx([0, 0, 0.5])
