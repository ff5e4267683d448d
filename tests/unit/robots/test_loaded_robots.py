"""Robots of other projects: each engine has them as they are described, or they are refused in one sentence."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from throwcollect.config.schema import Config
from throwcollect.engines.as_described import build_model, check_loaded
from throwcollect.engines.body import Placement
from throwcollect.engines.engine import Engine, Scene
from throwcollect.errors import ConfigError
from throwcollect.members import load_member
from throwcollect.robots import description
from throwcollect.robots.clearance import Clearance
from throwcollect.robots.description import physics_description
from throwcollect.robots.joint_model import joint_model, pose_of
from throwcollect.robots.robot import Robot
from throwcollect.robots.talos import TALOS
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
    "romeo_description/urdf/romeo": r"LFinger12 \(mimics LHand\)",
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
    Clearance(robot, joint_model(robot), CONFIG.tool)
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


@pytest.fixture(scope="module", params=["bullet", "mujoco"])
def loaded(request: pytest.FixtureRequest) -> tuple[str, Engine, Scene]:
    engine, scene = load_member("engines", request.param)(), scene_of(Config(), physics_description(Config()))
    engine.load(scene)
    check_loaded(engine, request.param, scene)
    return request.param, engine, scene


def change_link(scene: Scene, **changes: object) -> Scene:
    links = [replace(each, **changes) if each.name == "arm_right_2_link" else each for each in scene.robot.links]
    return replace(scene, robot=replace(scene.robot, links=tuple(links)))


def change_inertia(scene: Scene, **changes: object) -> Scene:
    (inertia,) = [each.inertia for each in scene.robot.links if each.name == "arm_right_2_link"]
    return change_link(scene, inertia=replace(inertia, **changes))


def turn_joint(scene: Scene) -> Scene:
    joints = [replace(each, axis=(0.0, 1.0, 0.0)) if each.moves else each for each in scene.robot.joints]
    return replace(scene, robot=replace(scene.robot, joints=tuple(joints)))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda scene: change_link(scene, shapes=()), "link arm_right_2_link"),
        (lambda scene: change_inertia(scene, mass_kg=3.2), "what moves with joint"),
        (lambda scene: change_inertia(scene, placement=Placement((0.0, 0.0, 0.01))), "what moves with joint"),
        (lambda scene: change_inertia(scene, moments_kgm2=(0.02, 0.0, 0.0, 0.02, 0.0, 0.02)), "what moves with joint"),
        (turn_joint, "what moves with joint"),
        (lambda scene: replace(scene, base_height_m=0.9), "the place of link spoon_link"),
    ],
)
def test_each_difference_between_engine_and_description_is_found(
    loaded: tuple[str, Engine, Scene], change: Callable[[Scene], Scene], words: str
) -> None:
    name, engine, scene = loaded
    with pytest.raises(ConfigError, match=f"{words}.*: the engine {name} has loaded something else"):
        check_loaded(engine, name, change(scene))


def measure_bullet(engine: Any, link: str) -> tuple[Any, Any]:
    number = next(number for (_, number), name in engine._scenery.names.items() if name == link)
    return engine._world.getAABB(engine._scenery.robot, number)


def measure_mujoco(engine: Any, link: str) -> tuple[Any, Any]:
    import mujoco

    model, data = engine._model, mujoco.MjData(engine._model)
    mujoco.mj_kinematics(model, data)
    body, boxes = model.body(link), []
    for geom in range(body.geomadr[0], body.geomadr[0] + body.geomnum[0]):
        half = np.abs(data.geom_xmat[geom].reshape(3, 3)) @ model.geom_aabb[geom, 3:]
        centre = data.geom_xpos[geom] + data.geom_xmat[geom].reshape(3, 3) @ model.geom_aabb[geom, :3]
        boxes.append((centre - half, centre + half))
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def test_both_engines_have_meshes_of_the_extent_of_the_files() -> None:
    scene = scene_of(CONFIG, physics_description(CONFIG))
    model = build_model(scene.robot)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    for name, measure in (("bullet", measure_bullet), ("mujoco", measure_mujoco)):
        engine = load_member("engines", name)()
        engine.load(scene)
        for link in scene.robot.links:
            pose = data.oMf[model.getFrameId(link.name, pinocchio.BODY)]
            if not link.shapes or any(shape.mesh is None for shape in link.shapes):
                continue
            poses = [(pose * pose_of(shape.placement), shape) for shape in link.shapes]
            points = np.array([each.act(point) for each, shape in poses for point in shape.mesh.corners * shape.size])
            points[:, 2] += scene.base_height_m
            low, high = map(np.array, measure(engine, link.name))
            # Engines add margins, and enclose boxes that are turned.
            assert (low < points.min(axis=0) + 1e-3).all(), (name, link.name)
            assert (high > points.max(axis=0) - 1e-3).all(), (name, link.name)
            assert np.max(high - low) < 2 * np.linalg.norm(np.ptp(points, axis=0)) + 0.02, (name, link.name)
        engine.close()
