import numpy as np
import pytest

from throwcollect.robots.tools.spoon.spoon import Spoon
from throwcollect.robots.tools.spoon.spoon_config import SpoonConfig


def gaps(tool, centre):
    """Distance from a point to the surface of each wall."""
    found = []
    for wall in tool.boxes[1:]:
        local = wall.placement.actInv(np.array(centre))
        outside = np.abs(local) - np.array(wall.size) / 2
        found.append(np.linalg.norm(np.maximum(outside, 0)))
    return found


@pytest.mark.parametrize("walls", [4, 6, 9])
@pytest.mark.parametrize("radius", [0.006, 0.025, 0.04])
def test_a_ball_touches_all_walls(walls, radius):
    tool = Spoon(SpoonConfig(cup_walls=walls))
    assert gaps(tool, tool.ball_seat(radius)) == pytest.approx([radius] * walls)


def test_a_ball_too_large_for_the_cup_lies_on_the_rim():
    tool = Spoon(SpoonConfig())
    assert gaps(tool, tool.ball_seat(0.09)) == pytest.approx([0.09] * 6, rel=0.01)


def test_a_ball_much_smaller_than_the_cup_lies_on_the_edge_of_the_floor():
    tool = Spoon(SpoonConfig(cup_floor_radius_m=0.019, cup_depth_m=0.01))
    assert gaps(tool, tool.ball_seat(0.0195)) == pytest.approx([0.0195] * 6)


def test_the_spoon_has_its_mass_and_balances_between_handle_and_cup():
    tool = Spoon(SpoonConfig(mass_kg=0.3))
    body = tool.inertia
    assert body.mass == pytest.approx(0.3)
    assert -0.195 < body.lever[2] < -0.075
    assert body.lever[1] == pytest.approx(0, abs=1e-12)


def test_the_walls_close_the_rim():
    tool = Spoon(SpoonConfig(cup_walls=5))
    first, second = tool.boxes[1:3]
    corner = np.array([first.size[0] / 2, -first.size[1] / 2, first.size[2] / 2])
    other = corner * [1, 1, -1]
    assert first.placement.act(corner) == pytest.approx(second.placement.act(other))


def tilt_up(tilt, azimuth=0.0):
    return np.array([np.cos(tilt), np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth)])


@pytest.mark.parametrize(("walls", "turn"), [(4, np.pi / 4), (6, np.pi / 6), (9, np.pi)])
@pytest.mark.parametrize("radius", [0.006, 0.025, 0.07, 0.09])
def test_a_ball_leaves_between_two_walls_at_a_tilt_equal_to_the_upright_slope(walls, turn, radius):
    tool = Spoon(SpoonConfig(cup_walls=walls))
    slope = tool.way_out(radius, tilt_up(0.0))
    # The way between two walls rises away from the axis, so a tilt away from it lowers it.
    for tilt in (0.1, slope, slope + 0.1):
        assert tool.way_out(radius, tilt_up(tilt, turn + np.pi)) == pytest.approx(slope - tilt, abs=1e-9)
    assert tool.way_out(radius, tilt_up(slope, turn + np.pi / walls)) > 0


def test_the_normals_of_the_walls_bound_the_tilts_at_which_the_ball_stays():
    """At rest the weight is carried by pushes of the walls, so it lies in the cone of their normals."""
    tool = Spoon(SpoonConfig())
    normals = [-wall.placement.rotation[:, 1] for wall in tool.boxes[1:]]
    for azimuth in np.linspace(0, 2 * np.pi, 37):
        for tilt in (0.3, 0.55, 0.58, 0.61, 0.66, 0.7):
            up = tilt_up(tilt, azimuth)
            inside = all(np.linalg.det([normals[i], normals[(i + 1) % 6], up]) > 0 for i in range(6))
            assert (tool.way_out(0.025, up) > 0) == inside
