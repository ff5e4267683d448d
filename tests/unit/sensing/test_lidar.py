"""Lidars measure boxes of known sizes, also where angles begin again."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.sensing.scenes import make_pose, make_shape, place_ball

from throwcollect.sensing.lidar import Lidar

AROUND = tuple((-np.pi + 2 * np.pi / 360 * np.arange(360)).tolist())
AT = make_pose((0.0, 0.0, 1.0))
FAR_AWAY = (0.0, 50.0, 1.0)


@pytest.mark.parametrize("azimuths", [AROUND, tuple(np.add(AROUND, np.pi).tolist())])
def test_walls_are_measured_all_around(azimuths: tuple[float, ...]) -> None:
    walls = [
        make_shape("front", "box", (0.1, 8.0, 2.0), (3.05, 0.0, 1.0)),
        make_shape("back", "box", (0.1, 1.0, 0.5), (-2.05, 0.0, 1.0)),
    ]
    scan = Lidar(azimuths, pose=AT).scan(place_ball(FAR_AWAY, *walls))
    x = np.cos(azimuths)
    expected = np.where(x > 0, 3.0, -2.0) / np.where(np.abs(x) < 1e-9, 1e-9, x)
    hits = np.abs(expected * np.sin(azimuths)) < np.where(x > 0, 4.0, 0.5)
    assert scan.ranges[0, hits] == pytest.approx(expected[hits], rel=1e-6)
    assert np.isinf(scan.ranges[0, ~hits]).all()
    assert set(scan.labels[0, hits].tolist()) == {4, 5}


def test_layers_hit_ball_and_ground() -> None:
    lidar = Lidar(AROUND, (-0.5, 0.0, 0.5), pose=AT)
    placed = place_ball((2.0, 0.0, 1.0))
    scan = lidar.scan(placed)
    assert scan.ranges[1, 180] == pytest.approx(1.9, abs=0.001)
    assert scan.labels[1, 180] == 2
    assert scan.ranges[0] == pytest.approx(1 / np.sin(0.5), rel=1e-6)
    assert (scan.labels[0] == placed.scene.ground).all()
    assert np.isposinf(scan.ranges[2]).all()
    assert not scan.labels[2].any()


def test_what_is_too_near_or_too_far_is_not_measured() -> None:
    near = Lidar(AROUND, pose=AT, near_m=2.5).scan(place_ball((2.0, 0.0, 1.0)))
    assert np.isneginf(near.ranges[0, 180])
    far = Lidar(AROUND, pose=AT, far_m=1.5).scan(place_ball((2.0, 0.0, 1.0)))
    assert np.isposinf(far.ranges[0, 180])


def test_a_box_around_the_axis_is_hit_by_all_rays() -> None:
    below = make_shape("table", "box", (20.0, 20.0, 0.5), (3.0, 2.0, 0.25))
    scan = Lidar(AROUND, (-1.5, -0.3), pose=AT).scan(place_ball(FAR_AWAY, below))
    assert scan.ranges[0] == pytest.approx(0.5 / np.sin(1.5), rel=1e-6)
    assert scan.ranges[1] == pytest.approx(0.5 / np.sin(0.3), rel=1e-6)
