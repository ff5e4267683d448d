from __future__ import annotations

import numpy as np
import pinocchio

from throwcollect.config.schema import Config
from throwcollect.episode.frames import read_frames
from throwcollect.robots.description import full_description
from throwcollect.robots.talos import TALOS

URDF = full_description(Config())


def transform(translation: tuple[float, float, float], quaternion: np.ndarray) -> pinocchio.SE3:
    x, y, z, w = quaternion
    return pinocchio.SE3(pinocchio.Quaternion(w, x, y, z).matrix(), np.array(translation))


def test_every_frame_of_talos_is_where_pinocchio_puts_it() -> None:
    tree = read_frames(URDF, base_height=0.0)
    assert {frame.joint for frame in tree.moving} == set(TALOS.joints)
    model = pinocchio.buildModelFromXML(URDF)
    data = model.createData()
    angles = dict(zip(TALOS.joints, np.random.default_rng(0).uniform(-1, 1, len(TALOS.joints)), strict=True))
    configuration = pinocchio.neutral(model)
    for joint, angle in angles.items():
        configuration[model.idx_qs[model.getJointId(joint)]] = angle
    pinocchio.framesForwardKinematics(model, data, configuration)
    places = {"world": pinocchio.SE3.Identity()}
    waiting = {
        **{each.child: (each, np.array(each.rotation_xyzw)) for each in tree.fixed},
        **{each.child: (each, each.rotation_at(np.array([angles[each.joint]]))[0]) for each in tree.moving},
    }
    while waiting:
        ready = [child for child, (frame, _) in waiting.items() if frame.parent in places]
        assert ready
        for child in ready:
            frame, rotation = waiting.pop(child)
            places[child] = places[frame.parent] * transform(frame.translation, rotation)
    for child, place in places.items():
        if child != "world":
            frame_id = model.getFrameId(child, pinocchio.BODY)
            assert np.allclose(place.homogeneous, data.oMf[frame_id].homogeneous, atol=1e-12), child


def test_the_robot_stands_at_the_height_of_its_base() -> None:
    root = read_frames(URDF, base_height=1.25).fixed[0]
    assert (root.parent, root.child, root.translation) == ("world", "base_link", (0.0, 0.0, 1.25))


def test_the_rotation_at_one_angle_equals_that_computed_with_many() -> None:
    frame = read_frames(URDF, base_height=1.0).moving[3]
    angles = np.random.default_rng(1).uniform(-7, 7, size=(500, 3))[:, 1]
    alone = np.concatenate([frame.rotation_at(angles[row : row + 1]) for row in range(len(angles))])
    assert alone.tobytes() == frame.rotation_at(angles).tobytes()
