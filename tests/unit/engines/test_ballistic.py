"""The engine `ballistic`, which has no contacts: where arm and ball are."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from tests.unit.engines.test_engine_contract import scene_with

from throwcollect.config.schema import Config
from throwcollect.engines.ballistic.tool_path import ToolPath
from throwcollect.engines.engine import Scene, ToolLink
from throwcollect.robots.description import start_posture
from throwcollect.robots.dynamics import ToolMotion
from throwcollect.robots.urdf import parse_xml, read_urdf
from throwcollect.sim.world import World

PLANAR = """<robot name="planar">
  <link name="base"/><link name="upper"/><link name="lower"/><link name="tip"/>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 0 2"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/>
  </joint>
  <joint name="elbow" type="{kind}">
    <parent link="upper"/><child link="lower"/><origin xyz="1 0 0" rpy="0 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/>
  </joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.5 0 0"/></joint>
</robot>"""


BALL = scene_with(radius_m=0.02).object


def planar(kind: str = "revolute") -> Scene:
    tool = ToolLink("tip", "tip", (1.0, 0.0, 0.0))
    robot = read_urdf(parse_xml(PLANAR.format(kind=kind), "planar"), "planar").model
    return Scene(robot, ("elbow", "shoulder"), 1.0, tool, ground_is_solid=False, object=BALL)


def test_the_path_of_the_tool_of_a_planar_arm_agrees_with_trigonometry() -> None:
    place, turn = ToolPath(planar()).along(np.array([[0.3, 0.2], [-0.5, math.pi / 2]]))
    for row, (elbow, shoulder) in enumerate([(0.3, 0.2), (-0.5, math.pi / 2)]):
        angle = shoulder + 0.5 + elbow
        x, y = math.cos(shoulder) + 0.5 * math.cos(angle), math.sin(shoulder) + 0.5 * math.sin(angle)
        assert place[row].ravel() == pytest.approx((x, y, 1.2), abs=1e-12)
        assert turn[row][:, 0] == pytest.approx((math.cos(angle), math.sin(angle), 0.0), abs=1e-12)


def test_a_prismatic_joint_moves_the_tool_along_its_axis() -> None:
    place, turn = ToolPath(planar("prismatic")).along(np.array([[0.3, 0.2]]))
    x, y = math.cos(0.2) + 0.5 * math.cos(0.7), math.sin(0.2) + 0.5 * math.sin(0.7)
    assert place[0].ravel() == pytest.approx((x, y, 1.5), abs=1e-12)
    assert turn[0][:, 0] == pytest.approx((math.cos(0.7), math.sin(0.7), 0.0), abs=1e-12)


def test_the_ball_stays_in_the_spoon_until_the_spoon_brakes() -> None:
    config = Config.model_validate({"sim": {"engine": "ballistic"}})
    world = World(config)
    start = np.array([start_posture(config)[joint] for joint in world.moving])
    end = np.array([config.task.end[joint] for joint in world.moving])
    x = np.minimum(np.arange(1, 1001) / 500, 1.0)
    world.run(start + (10 * x**3 - 15 * x**4 + 6 * x**5)[:, np.newaxis] * (end - start))
    samples = world.samples()
    (contact,) = world.contacts()
    assert (contact.body, contact.start_ns) == ("spoon", 0)
    assert contact.end_ns is not None
    # The spoon is fastest at half a second, and brakes from there on.
    assert 0.5e9 < contact.end_ns < 0.8e9
    spoon = ToolMotion(config)
    held = int(np.searchsorted(samples.stamps_ns, contact.end_ns))
    for row in range(0, held, 10):
        assert samples.object_position[row] == pytest.approx(spoon.place(samples.position[row]), abs=1e-9)
    assert samples.object_position[held + 5] != pytest.approx(spoon.place(samples.position[held + 5]), abs=1e-4)
    assert world.end_reason == "landed"
    assert not samples.effort.any()


def test_a_throw_with_the_engine_ballistic_needs_no_bullet() -> None:
    code = """
import sys
sys.modules["pybullet"] = None  # whoever imports it fails
from throwcollect import Simulator
with Simulator("configs/quickstart.yaml", overrides=["sim.engine=ballistic"]) as simulator:
    print(simulator.throw().row["outcome"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout == "landed\n", done.stderr
