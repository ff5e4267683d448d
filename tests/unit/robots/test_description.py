import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from throwcollect.config.schema import Config, RobotConfig
from throwcollect.robots.description import (
    full_description,
    physics_description,
    start_posture,
)
from throwcollect.robots.talos import TALOS

JOINTS = TALOS.joints

CONFIG = Config()
MOVED = tuple(CONFIG.task.end)


def with_robot(**values):
    return CONFIG.model_copy(update={"robot": RobotConfig.model_construct(**{**dict(CONFIG.robot), **values})})


def configuration(model, posture):
    q = pinocchio.neutral(model)
    for name, angle in posture.items():
        if model.existJointName(name):
            q[model.idx_qs[model.getJointId(name)]] = angle
    return q


def write(model):
    """URDF of a body with the paths of its meshes."""
    text = model.write_urdf()
    for number, mesh in enumerate(model.meshes):
        text = text.replace(f'"{number}.stl"', f'"{mesh.path}"')
    return text


def collision_shapes(urdf, posture):
    """Mesh names or primitive types with their places in the world, for a posture."""
    model = pinocchio.buildModelFromXML(urdf)
    geometry = pinocchio.buildGeomFromUrdfString(
        model, urdf, pinocchio.GeometryType.COLLISION, package_dirs=[str(TALOS.share())]
    )
    data, places = model.createData(), geometry.createData()
    pinocchio.updateGeometryPlacements(model, data, geometry, places, configuration(model, posture))
    return sorted(
        (Path(shape.meshPath).name, *np.round(place.translation, 9), *np.round(place.rotation.ravel(), 9))
        for shape, place in zip(geometry.geometryObjects, places.oMg, strict=True)
    )


def test_by_default_joints_that_the_task_does_not_move_are_locked():
    made = physics_description(CONFIG)
    assert made.moving == tuple(joint for joint in JOINTS if joint in MOVED)
    assert set(made.locked) == set(JOINTS) - set(MOVED)
    assert set(pinocchio.buildModelFromXML(made.model.write_urdf()).names[1:]) == set(MOVED)


def test_no_joint_is_locked_if_locked_is_none():
    made = physics_description(with_robot(locked="none"))
    assert made.moving == JOINTS
    assert made.locked == {}
    assert set(pinocchio.buildModelFromXML(made.model.write_urdf()).names[1:]) == set(JOINTS)


def test_a_list_of_locked_joints_locks_exactly_these():
    made = physics_description(with_robot(locked=["head_1_joint", "leg_left_4_joint"]))
    assert list(made.locked) == ["leg_left_4_joint", "head_1_joint"]
    assert len(made.moving) == 30


def test_the_start_of_a_joint_comes_from_the_task_else_posture_else_rest():
    posture = start_posture(with_robot(posture={"arm_right_4_joint": -1.0, "head_1_joint": 0.3}))
    assert posture["arm_right_4_joint"] == CONFIG.task.start["arm_right_4_joint"]
    assert posture["head_1_joint"] == 0.3
    assert posture["leg_left_4_joint"] == TALOS.rest_posture["leg_left_4_joint"] != 0
    assert tuple(posture) == JOINTS


def test_the_full_description_holds_talos_and_the_spoon():
    robot = ElementTree.fromstring(full_description(CONFIG))  # noqa: S314
    assert {j.get("name") for j in robot.iter("joint") if j.get("type") == "revolute"} == set(JOINTS)
    mount = robot.find("joint[@name='spoon_joint']")
    assert mount.find("parent").get("link") == "gripper_right_base_link"
    assert mount.find("child").get("link") == "spoon_link"
    spoon = robot.find("link[@name='spoon_link']")
    assert len(spoon.findall("collision")) == len(spoon.findall("visual")) == 1 + CONFIG.tool.cup_walls
    assert all(mesh.get("filename").startswith("package://") for mesh in robot.iter("mesh"))


@pytest.mark.parametrize("make", [full_description, lambda config: write(physics_description(config).model)])
def test_the_right_gripper_has_no_collision_shapes(make):
    robot = ElementTree.fromstring(make(CONFIG))  # noqa: S314
    gripper = [link for link in robot.iter("link") if link.get("name").startswith("gripper_right_")]
    assert not any(link.findall("collision") for link in gripper)
    left = [mesh.get("filename") for mesh in robot.iterfind("link/collision/geometry/mesh")]
    assert any("gripper" in name for name in left)


@pytest.mark.parametrize("locked", ["auto", "none", ["head_1_joint"]])
def test_merging_locked_links_keeps_the_dynamics_of_the_moving_joints(locked):
    config = with_robot(locked=locked)
    made = physics_description(config)
    merged = pinocchio.buildModelFromXML(made.model.write_urdf())
    full = pinocchio.buildModelFromXML(full_description(config))
    random = np.random.default_rng(3)
    for _ in range(5):
        angles, speeds, accelerations = (
            dict(zip(made.moving, random.uniform(-1, 1, len(made.moving)), strict=True)) for _ in range(3)
        )
        torques = [
            dict(zip(model.names[1:], pinocchio.rnea(model, model.createData(), *arguments), strict=True))
            for model in (merged, full)
            for arguments in [
                (
                    configuration(model, {**made.locked, **angles}),
                    configuration(model, speeds),
                    configuration(model, accelerations),
                )
            ]
        ]
        for joint in made.moving:
            assert torques[0][joint] == pytest.approx(torques[1][joint], abs=1e-9)


def test_merging_locked_links_keeps_every_collision_shape_in_its_place():
    posture = start_posture(CONFIG)
    assert collision_shapes(write(physics_description(CONFIG).model), posture) == collision_shapes(
        full_description(CONFIG), posture
    )
