"""Robots of other projects: each engine has them as they are described, or they are refused in one sentence."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.as_described import check_loaded
from throwcollect.engines.engine import Engine, LoadedLink, Scene
from throwcollect.errors import ConfigError
from throwcollect.members import load_member
from throwcollect.robots import description
from throwcollect.robots.clearance import Clearance
from throwcollect.robots.description import physics_description
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.robot import Robot
from throwcollect.robots.talos import TALOS
from throwcollect.robots.tools.tool import tool_of
from throwcollect.sim.scene import scene_of

ROBOTS = TALOS.urdf_path.parents[2]
CONFIG = Config.model_validate({"robot": {"locked": "none"}})

REFUSED = {
    "anymal_c_simple_description/urdf/anymal": "a joint has the name of a link: LF_HAA",
    "baxter_description/urdf/baxter": r"l_gripper_r_finger_joint \(mimics l_gripper_l_finger_joint\)",
    "centauro_description/urdf/centauro": "link pelvis: .* has no usable convex hull: .*Too many neighbors",
    "double_pendulum_description/urdf/double_pendulum_continuous": r"joint1 \(continuous\), joint2 \(continuous\)",
    "icub_description/robots/icub": "r_hip_1.* has principal moments of inertia of 0, 0 and 0 kg m², which no body",
    "panda_description/urdf/panda": r"panda_finger_joint1 \(prismatic\), panda_finger_joint2 \(mimics",
    "romeo_description/urdf/romeo": "joints of controllers should be revolute; LFinger12 mimics LHand",
    "ur_description/urdf/ur3": "has no links",
}
"""What is wrong with those robots of example-robot-data that are refused."""

EQUAL = [
    "alexander_description/urdf/alexander_v1.lowerBodyOnly",
    "allegro_hand_description/urdf/allegro_left_hand",
    "double_pendulum_description/urdf/double_pendulum",
    "hextilt_description/urdf/hextilt_flying_arm_5",
    "hyq_description/robots/hyq_no_sensors",
    "simple_humanoid_description/urdf/simple_humanoid",
    "talos_data/robots/talos_left_arm",
    "ur_description/urdf/ur5_robot",
]


def make_robot(path: Path, directory: Path) -> Robot:
    """A robot whose joints that turn all belong to one controller, and whose hand is its last link."""
    root = ElementTree.parse(path).getroot()  # noqa: S314
    srdf = directory / "robot.srdf"
    srdf.write_text('<robot name="robot"><group_state name="rest" group="all"/></robot>')
    joints = tuple(joint.get("name", "") for joint in root.findall("joint") if joint.get("type") == "revolute")
    *_, hand = ["hand", *(link.get("name", "") for link in root.findall("link"))]
    return Robot(
        name="robot",
        title=path.stem,
        controllers={"arm_controller": joints},
        share=lambda: TALOS.directory,
        urdf=str(path),
        srdf=str(srdf),
        rest="rest",
        hand=hand,
    )


def load_everywhere(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Do what a plan does with a robot: describe it, read its shapes, and load it into each engine."""
    monkeypatch.setattr(description, "find_robot", lambda _: robot)
    scene = scene_of(CONFIG, physics_description(CONFIG))
    Clearance(robot, joint_model(robot), tool_of(CONFIG))
    for name in ("bullet", "mujoco"):
        engine = load_member("engines", name)()
        try:
            engine.load(scene)
            check_loaded(engine, name, scene)
        finally:
            engine.close()


@pytest.mark.parametrize("name", EQUAL)
def test_both_engines_have_a_robot_as_it_is_described(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    load_everywhere(make_robot(ROBOTS / f"{name}.urdf", tmp_path), monkeypatch)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", REFUSED)
def test_a_robot_that_cannot_be_simulated_is_refused_in_one_sentence(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ConfigError, match=REFUSED[name]) as refused:
        load_everywhere(make_robot(ROBOTS / f"{name}.urdf", tmp_path), monkeypatch)
    assert name in str(refused.value)
    assert capfd.readouterr() == ("", "")


class Changed(Engine):
    """An engine that has one link other than it was given."""

    def __init__(self, engine: Engine, link: str, **changes: object) -> None:
        self._links = [
            replace(each, **changes) if each.name == link else each for each in engine.describe_robot() or ()
        ]

    def describe_robot(self) -> list[LoadedLink]:
        return self._links


Changed.__abstractmethods__ = frozenset()  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def loaded() -> tuple[Engine, Scene]:
    engine, scene = load_member("engines", "mujoco")(), scene_of(Config(), physics_description(Config()))
    engine.load(scene)
    return engine, scene


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"name": "other"}, "no such link"),
        ({"mass_kg": 1.0}, "a mass of 1 kg, not 3.14758 kg"),
        ({"centre": np.zeros(3)}, "its centre of mass at"),
        ({"inertia": np.zeros((3, 3))}, "principal moments of inertia of"),
        ({"shapes": 1}, "1 of its 2 collision shapes"),
        ({"box": ((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))}, "collision shapes of another extent"),
        ({"axis": np.array([0.0, 0.0, 1.0])}, "another joint axis"),
        ({"range": (-1.0, 1.0)}, "other limits of its joint"),
    ],
)
def test_each_difference_between_engine_and_description_is_found(
    loaded: tuple[Engine, Scene], changes: dict[str, object], words: str
) -> None:
    engine, scene = loaded
    check_loaded(engine, "mujoco", scene)
    with pytest.raises(ConfigError, match=f"link arm_right_2_link: the engine mujoco has {words}"):
        check_loaded(Changed(engine, "arm_right_2_link", **changes), "mujoco", scene)
