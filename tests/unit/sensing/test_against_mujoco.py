"""Cameras and lidars agree with the rays of MuJoCo, on random postures whose links Pinocchio places."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.unit.sensing.scenes import make_matrix, make_pose

from throwcollect.config.loader import load
from throwcollect.engines.pose import OPTICAL, Pose
from throwcollect.episode.frames import WORLD
from throwcollect.extras import is_installed
from throwcollect.robots.description import robot_of
from throwcollect.robots.joint_model import joint_model
from throwcollect.sensing.camera import Camera
from throwcollect.sensing.lidar import Lidar
from throwcollect.sensing.scene import PlacedScene, Scene

CONFIGS = Path(__file__).parents[3] / "configs"
EYE, CENTRE = (1.4, -1.3, 1.5), (0.1, -0.1, 0.9)

pytestmark = pytest.mark.skipif(not is_installed("mujoco"), reason="MuJoCo is not installed")


class Posed(NamedTuple):
    """A scene in random postures, and MuJoCo's model of the same triangles."""

    scene: Scene
    positions: list[NDArray[np.float64]]
    robot: Any
    base_m: float
    model: Any
    data: Any
    links: list[str]

    def place(self, number: int) -> PlacedScene:
        """Put both scenes in a posture."""
        import mujoco
        import pinocchio

        model = joint_model(self.robot)
        data = model.createData()
        position = pinocchio.neutral(model)
        for name, value in zip(self.robot.joints, self.positions[number], strict=True):
            position[model.joints[model.getJointId(name)].idx_q] = value
        pinocchio.framesForwardKinematics(model, data, position)
        for body, link in enumerate(self.links, start=1):
            if model.existFrame(link) and link != WORLD:
                pose = data.oMf[model.getFrameId(link)]
                self.model.body_pos[body] = np.array([0, 0, self.base_m]) + pose.translation
                self.model.body_quat[body] = pinocchio.Quaternion(pose.rotation).coeffs()[[3, 0, 1, 2]]
        placed = self.scene.place(self.positions[number], [Pose(origin=(0.5, -0.5, 1.3))])
        # The tool hangs on the hand, and the ball is where it was put.
        for body, link in enumerate(self.links, start=1):
            if not model.existFrame(link):
                pose = placed.find(link)
                self.model.body_pos[body] = pose.origin
                mujoco.mju_mat2Quat(self.model.body_quat[body], np.array(pose.rows).ravel())
        mujoco.mj_kinematics(self.model, self.data)
        return placed

    def trace(
        self, eye: tuple[float, float, float], directions: NDArray[np.float64]
    ) -> tuple[NDArray[np.uint16], NDArray[np.float64], NDArray[np.bool_]]:
        """Follow rays, shape ``(n, 3)``: the label that each hits, how many times as far, and if from inside.

        MuJoCo also sees triangles from behind, such as the inside of a mesh with a hole.
        """
        import mujoco

        count = len(directions)
        geoms, distances = np.full(count, -1, np.int32), np.full(count, -1.0)
        origin = np.array(eye)
        length = np.sqrt((directions**2).sum(axis=1))
        rays = np.ascontiguousarray(directions / length[:, np.newaxis]).ravel()
        normals = np.zeros(3 * count)
        mujoco.mj_multiRay(self.model, self.data, origin, rays, None, 1, -1, geoms, distances, normals, count, 1e3)
        names = ["ground", *self.links]
        labels = np.array([self.scene.labels.index(names[geom]) if geom >= 0 else 0 for geom in geoms], np.uint16)
        behind = (normals.reshape(-1, 3) * directions).sum(axis=1) > 0
        return labels, np.where(geoms < 0, np.inf, distances / length), behind


@pytest.fixture(scope="module", params=["quickstart", "ur5", "xarm7"])
def posed(request: pytest.FixtureRequest) -> Posed:
    import mujoco

    config = load(CONFIGS / f"{request.param}.yaml")
    scene, robot = Scene.of(config), robot_of(config)
    spec, links = mujoco.MjSpec(), []
    for number in np.unique(scene.labels_of).tolist():
        link = scene.labels[number]
        # The column under an arm belongs to a link with the name of the world.
        within = Pose() if link == WORLD else scene.links[link][1]
        corners, faces = _cut_out(scene, number, within)
        spec.add_mesh(
            name=link,
            uservert=corners.T.ravel(),
            userface=faces.T.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body = spec.worldbody.add_body(name=f"{link}_body")
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=link)
        links.append(link)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], name="ground")
    model = spec.compile()
    rng = np.random.default_rng(7)
    limits = [robot.description.joints[name].limits for name in robot.joints]
    positions = [np.array([rng.uniform(*each[:2]) for each in limits if each]) for _ in range(2)]
    return Posed(scene, positions, robot, config.robot.base_height_m, model, mujoco.MjData(model), links)


def _cut_out(scene: Scene, label: int, within: Pose) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the triangles of a label in the frame of its link."""
    used, faces = np.unique(scene.faces[:, scene.labels_of == label], return_inverse=True)
    back = within.inverse()
    corners = np.array(back.rows) @ scene.corners[:, used] + np.reshape(back.origin, (3, 1))
    return corners, faces.reshape(3, -1)


@pytest.mark.parametrize("number", [0, 1])
def test_a_camera_sees_what_rays_hit(posed: Posed, number: int) -> None:
    placed = posed.place(number)
    pose = Pose.looking_at(EYE, CENTRE)
    rpy = (0.0, np.arcsin(-pose.rows[2][0]), np.arctan2(pose.rows[1][0], pose.rows[0][0]))
    camera = Camera(160, 120, 1.05, pose=make_pose(EYE, rpy), far_m=1e3)
    frame = camera.render(placed, color=False)
    row, column = np.mgrid[:120, :160]
    inverse = np.linalg.inv(make_matrix(camera))
    rays = np.stack([column.ravel(), row.ravel(), np.ones(160 * 120)], axis=1) @ inverse.T
    _compare(posed, frame.labels, frame.depth, posed.trace(EYE, rays @ np.array((pose * OPTICAL).rows).T))


def test_a_lidar_measures_what_rays_hit(posed: Posed) -> None:
    placed = posed.place(0)
    azimuths = tuple(-np.pi + 2 * np.pi / 360 * np.arange(360))
    lidar = Lidar(azimuths, tuple(np.radians(-15 + 2 * np.arange(16))), pose=make_pose((0.9, 0.0, 1.0)), far_m=1e3)
    scan = lidar.scan(placed)
    _compare(posed, scan.labels, scan.ranges, posed.trace((0.9, 0.0, 1.0), lidar.directions.reshape(3, -1).T))


def _compare(
    posed: Posed,
    labels: NDArray[np.uint16],
    distance: NDArray[np.float32],
    traced: tuple[NDArray[np.uint16], NDArray[np.float64], NDArray[np.bool_]],
) -> None:
    expected, far, behind = traced
    same = labels.ravel() == expected
    assert behind.mean() < 0.01
    assert same.mean() >= 0.998
    on_bodies = same & ~behind & (expected > 0) & (expected != posed.scene.ground)
    off = np.abs(distance.ravel()[on_bodies] - far[on_bodies])
    assert np.quantile(off, 0.999) <= 0.001
