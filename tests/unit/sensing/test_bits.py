"""Sensors give the same bytes on processors with and without vector instructions."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from tests.processors import PLAIN

PROGRAM = """
import hashlib
import numpy as np
from tests.unit.sensing.scenes import make_pose
from throwcollect.config.loader import load
from throwcollect.robots.description import robot_of
from throwcollect.sensing.camera import Camera
from throwcollect.sensing.lidar import Lidar
from throwcollect.engines.pose import Pose
from throwcollect.sensing.scene import Scene
from throwcollect.sensing.view import View

config = load("configs/quickstart.yaml")
scene, robot = Scene.of(config), robot_of(config)
placed = scene.place(robot.rest_posture.values(), [Pose(origin=(0.7, -0.2, 1.1))])
frame = Camera(160, 120, 1.0, pose=make_pose((1.5, -1.2, 1.4), (0.0, 0.3, 2.4)), smooth=True).render(placed)
head = Camera(96, 96, 1.0, link="head_2_link", pose=make_pose((0.0, 0.0, 0.0), (0.0, 0.5, 0.0))).render(placed)
scan = Lidar(tuple(np.linspace(-3.0, 3.0, 200)), (-0.2, 0.0, 0.3), pose=make_pose((0.9, 0.0, 1.0))).scan(placed)
assert len(np.unique(frame.labels)) > 20 and len(np.unique(scan.labels)) > 4
pictures = [frame.color, frame.depth, frame.labels, head.color, head.depth, scan.ranges, scan.labels]
# Few of the last bits of what pictures are made of would be seen in them.
seen = View.of(placed, make_pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), lambda *_: True)
numbers = [scene.corners, scene.normals, np.array(placed.poses[-2].rows), seen.corners, *seen.find_planes()]
for each in pictures + numbers:
    print(hashlib.sha256(each.tobytes()).hexdigest())
"""


def test_bytes_are_the_same_without_vector_instructions(capsys: pytest.CaptureFixture[str]) -> None:
    words = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    plain = subprocess.run(words, env=os.environ | PLAIN, capture_output=True, text=True, check=True).stdout
    exec(PROGRAM, {})  # noqa: S102
    assert len(plain.split()) == 13
    assert capsys.readouterr().out == plain
