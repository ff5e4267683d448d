"""Cameras see balls and boxes of known sizes where they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.unit.sensing.scenes import make_matrix, make_pose, make_scene, make_shape, place_ball

from throwcollect.engines.pose import Pose
from throwcollect.errors import ConfigError
from throwcollect.sensing.camera import Camera

CAMERA = Camera(320, 240, 1.0, pose=make_pose((0.1, -0.2, 1.0), (0.0, 0.1, 0.2)))
RADIUS = 0.1
FORWARD = Camera(160, 120, 1.0, pose=make_pose((0.0, 0.0, 1.0)))


def find_rays(camera: Camera) -> NDArray[np.float64]:
    """Directions of the rays through all pixels in the optical frame, shape ``(height, width, 3)``."""
    row, column = np.mgrid[: camera.height, : camera.width]
    pixels = np.stack([column, row, np.ones_like(row)], axis=-1)
    rays: NDArray[np.float64] = pixels @ np.linalg.inv(make_matrix(camera)).T
    return rays


@pytest.mark.parametrize("place", [(2.0, 0.5, 1.1), (1.2, 0.2, 0.6), (4.0, 1.5, 2.0)])
def test_a_ball_has_its_place_its_size_and_its_depth(place: tuple[float, float, float]) -> None:
    placed = place_ball(place)
    frame = CAMERA.render(placed, color=False)
    middle = np.array(CAMERA.find_optical(placed).inverse().move(place))
    rays = find_rays(CAMERA)
    # A ray of length 1 along the optical axis meets the ball where a quadratic equation has its lesser solution.
    a, b, c = (rays**2).sum(axis=-1), rays @ middle, (middle**2).sum() - RADIUS**2
    inside = b * b - a * c
    expected = inside > 0
    depth = (b - np.sqrt(np.where(expected, inside, 0))) / a
    seen = frame.labels == placed.scene.labels.index("ball")
    assert abs(seen.sum() - expected.sum()) <= max(1, 0.002 * expected.sum())
    assert np.argwhere(seen).mean(axis=0) == pytest.approx(np.argwhere(expected).mean(axis=0), abs=0.05)
    assert math.sqrt(seen.sum() / math.pi) == pytest.approx(math.sqrt(expected.sum() / math.pi), abs=0.1)
    # At the border, the surface is seen so flat that its depth changes by centimetres from one pixel to the next.
    clear = seen & (inside > 0.1 * inside.max())
    assert np.abs(frame.depth - depth)[clear].max() <= 0.001


def test_left_is_left_and_up_is_up() -> None:
    left = np.argwhere(FORWARD.render(place_ball((2.0, 0.5, 1.0))).labels == 2).mean(axis=0)
    up = np.argwhere(FORWARD.render(place_ball((2.0, 0.0, 1.5))).labels == 2).mean(axis=0)
    assert left == pytest.approx([59.5, 79.5 - 0.25 * FORWARD.focal_px], abs=0.5)
    assert up == pytest.approx([59.5 - 0.25 * FORWARD.focal_px, 79.5], abs=0.5)


def test_the_ground_has_its_depth_and_nothing_lies_below_it() -> None:
    placed = place_ball((-5.0, 0.0, 1.0))
    camera = Camera(160, 120, 1.0, pose=FORWARD.pose, far_m=1e3)
    frame, rays = camera.render(placed, color=False), find_rays(camera)
    ground = frame.labels == placed.scene.ground
    assert ground[60:].all()
    assert not ground[:60].any()
    assert frame.depth[ground] == pytest.approx((1.0 / rays[..., 1])[ground], rel=1e-6)
    assert np.isinf(frame.depth[~ground]).all()
    below = Camera(64, 48, 1.0, pose=make_pose((0.0, 0.0, -1.0)))
    assert not below.render(placed, color=False).labels.any()


def test_what_is_beyond_the_far_plane_is_not_seen() -> None:
    near = Camera(160, 120, 1.0, pose=FORWARD.pose, far_m=3.0)
    assert (near.render(place_ball((2.0, 0.0, 1.0))).labels == 2).any()
    assert not (near.render(place_ball((3.5, 0.0, 1.0))).labels == 2).any()
    assert (FORWARD.render(place_ball((3.5, 0.0, 1.0))).labels == 2).any()


def test_a_camera_looks_out_of_the_body_that_it_is_in() -> None:
    around = make_shape("case", "box", (0.3, 0.3, 0.3), (0.0, 0.0, 1.0))
    frame = FORWARD.render(place_ball((2.0, 0.0, 1.0), around))
    assert frame.labels[60, 80] == 2
    assert not (frame.labels == 4).any()


def test_what_reaches_behind_the_camera_is_cut_off_in_front_of_it() -> None:
    table = make_shape("table", "box", (20.0, 20.0, 0.5), (0.0, 0.0, 0.35))
    placed = place_ball((2.0, 0.0, 3.0), table)
    for roll in (0.0, 0.7):
        camera = Camera(160, 120, 1.0, pose=make_pose((0.0, 0.0, 1.0), (roll, 0.0, 0.0)), far_m=8.0)
        frame, falls = camera.render(placed, color=False), -find_rays(camera) @ camera.find_optical(placed).rows[2]
        depth = 0.4 / np.where(falls > 0, falls, 1e-9)
        expected = depth < 8.0
        assert ((frame.labels == 4) == expected).mean() > 0.999
        assert frame.depth[frame.labels == 4] == pytest.approx(depth[frame.labels == 4], rel=1e-6)


def test_a_near_plane_cuts_into_a_body() -> None:
    # The plane goes through the middle of the ball: nothing is left but what the camera would see from inside.
    cut = Camera(160, 120, 1.0, pose=FORWARD.pose, near_m=2.0)
    assert not (cut.render(place_ball((2.0, 0.0, 1.0))).labels == 2).any()
    half = Camera(160, 120, 1.0, pose=FORWARD.pose, near_m=1.95)
    frame = half.render(place_ball((2.0, 0.0, 1.0)))
    ring = frame.labels == 2
    assert ring.any()
    assert not ring[60, 80]
    assert frame.depth[ring].min() >= 1.95


def test_a_shadow_lies_on_the_ground_and_edges_are_smooth() -> None:
    above = Camera(160, 120, 1.0, pose=make_pose((0.0, 0.0, 3.0), (0.0, math.pi / 2, 0.0)))
    with_ball, without = (above.render(place_ball(at)) for at in ((0.3, 0.0, 1.0), (0.0, 0.0, -1.0)))
    assert with_ball.color is not None
    assert without.color is not None
    darker = (with_ball.color < 0.8 * without.color).all(axis=2)
    ground = with_ball.labels == 3
    assert 30 < (darker & ground).sum() < 100
    fine = Camera(160, 120, 1.0, pose=above.pose, smooth=True).render(place_ball((0.3, 0.0, 1.0)))
    assert fine.color is not None
    changed = (fine.color != with_ball.color).any(axis=2)
    assert 10 < changed.sum() < 100
    # Each changed pixel is at the border of the ball.
    ball = np.pad(with_ball.labels == 2, 1)
    at_border = np.zeros_like(changed)
    for row in range(3):
        for column in range(3):
            at_border |= ball[row : row + 120, column : column + 160] != ball[1:-1, 1:-1]
    assert not (changed & ~at_border).any()


def test_a_camera_moves_with_its_link() -> None:
    urdf = """
    <robot name="crane"><link name="post"/><link name="boom"/><link name="hook"/>
    <joint name="turn" type="revolute"><parent link="post"/><child link="boom"/><origin xyz="0 0 1" rpy="0 0 1.5708"/>
      <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
    <joint name="lift" type="prismatic"><parent link="boom"/><child link="hook"/><origin xyz="2 0 0"/>
      <axis xyz="0 0 2"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
    scene = make_scene(urdf=urdf, joints=("lift", "turn"))
    placed = scene.place([-0.25, -math.pi / 2], [Pose(origin=(5.0, 0.0, 1.25))])
    assert placed.find("hook").origin == pytest.approx((2.0, 0.0, 1.25), abs=1e-5)
    frame = Camera(65, 49, 1.0, link="hook").render(placed)
    assert scene.labels[frame.labels[24, 32]] == "ball"
    assert frame.depth[24, 32] == pytest.approx(2.9, abs=0.002)
    with pytest.raises(ConfigError, match="no link hok"):
        placed.find("hok")
