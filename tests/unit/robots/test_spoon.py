import numpy as np
import pytest

from throwcollect.config.schema import ToolConfig
from throwcollect.errors import ConfigError
from throwcollect.robots.spoon import ball_seat, boxes, inertia


def gaps(tool, centre):
    """Distance from a point to the surface of each wall."""
    found = []
    for wall in boxes(tool)[1:]:
        local = wall.placement.actInv(np.array(centre))
        outside = np.abs(local) - np.array(wall.size) / 2
        found.append(np.linalg.norm(np.maximum(outside, 0)))
    return found


@pytest.mark.parametrize("walls", [4, 6, 9])
@pytest.mark.parametrize("radius", [0.006, 0.025, 0.04])
def test_a_ball_touches_all_walls(walls, radius):
    tool = ToolConfig(cup_walls=walls)
    assert gaps(tool, ball_seat(tool, radius)) == pytest.approx([radius] * walls)


def test_a_ball_too_large_for_the_cup_lies_on_the_rim():
    tool = ToolConfig()
    assert gaps(tool, ball_seat(tool, 0.09)) == pytest.approx([0.09] * 6, rel=0.01)


def test_a_ball_much_smaller_than_the_cup_lies_on_the_edge_of_the_floor():
    tool = ToolConfig(cup_floor_radius_m=0.019, cup_depth_m=0.01)
    assert gaps(tool, ball_seat(tool, 0.0195)) == pytest.approx([0.0195] * 6)


def test_a_ball_that_falls_through_the_floor_is_refused():
    with pytest.raises(ConfigError, match=r"ball\.radius_m: a ball of radius 0\.005 m falls through the floor"):
        ball_seat(ToolConfig(cup_floor_radius_m=0.005), 0.005)


def test_the_spoon_has_its_mass_and_balances_between_handle_and_cup():
    tool = ToolConfig(mass_kg=0.3)
    body = inertia(tool)
    assert body.mass == pytest.approx(0.3)
    assert -0.195 < body.lever[2] < -0.075
    assert body.lever[1] == pytest.approx(0, abs=1e-12)


def test_the_walls_close_the_rim():
    tool = ToolConfig(cup_walls=5)
    first, second = boxes(tool)[1:3]
    corner = np.array([first.size[0] / 2, -first.size[1] / 2, first.size[2] / 2])
    other = corner * [1, 1, -1]
    assert first.placement.act(corner) == pytest.approx(second.placement.act(other))
