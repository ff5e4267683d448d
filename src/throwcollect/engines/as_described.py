"""Compares the robot that an engine has loaded with the values that it was given.

Engines drop or change what they cannot use, and go on: shapes, inertias, axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from throwcollect.engines.body import BodyModel
from throwcollect.engines.engine import Engine, LoadedRobot, Scene
from throwcollect.engines.grip import add_held_link
from throwcollect.engines.native_reading import reading_natively
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError

_SHARE = 1e-3
"""Largest difference of numbers of a mass matrix, as a share of the root of the product of those on the diagonal."""
_PLACE_M = 1e-4


def build_model(robot: BodyModel) -> pinocchio.Model:
    """Build Pinocchio's model of a robot from links and joints alone, as Pinocchio would read other things otherwise.

    Raises:
        ValueError: If Pinocchio does not take the robot.
        RuntimeError: Likewise.
    """
    bare = replace(robot, links=tuple(replace(link, shapes=()) for link in robot.links))
    with reading_natively():
        return pinocchio.buildModelFromXML(bare.write_urdf())


def check_loaded(engine: Engine, name: str, scene: Scene) -> None:
    """Make sure that an engine has loaded the robot of a scene as it is described, right after `Engine.load`.

    The mass matrix shows masses, inertias and axes of all that moves; the posture is one in which no axes are parallel.

    Args:
        engine: The engine.
        name: Its name, for messages.
        scene: The scene that it has loaded.
    """
    positions = np.linspace(0.3, 0.7, len(scene.moving))
    found, wanted = engine.describe_robot(positions.tolist()), _describe(scene, positions)
    if found is None:
        return
    differing = [f"link {link}" for link, count in wanted.shapes.items() if found.shapes.get(link) != count]
    scale = np.sqrt(np.diag(wanted.mass_matrix))
    wrong = ~(np.abs(found.mass_matrix - wanted.mass_matrix) <= _SHARE * scale * scale[:, np.newaxis])
    differing += [f"what moves with joint {scene.moving[column]}" for column in np.flatnonzero(wrong.any(axis=0))]
    if not np.allclose(found.tool_m, wanted.tool_m, rtol=0, atol=_PLACE_M):
        differing.append(f"the place of link {scene.tool.link}")
    if differing:
        raise ConfigError(
            f"{scene.robot.name}: {differing[0]}: the engine {name} has loaded something else than is described",
            hint="correct it in a copy of the URDF, or choose another sim.engine",
        )


def _describe(scene: Scene, positions: np.ndarray) -> LoadedRobot:
    model = build_model(add_held_link(scene.robot, scene.tool))
    data, posture = model.createData(), pinocchio.neutral(model)
    columns = [model.idx_qs[model.getJointId(joint)] for joint in scene.moving]
    posture[columns] = positions
    upper = np.triu(pinocchio.crba(model, data, posture))
    whole = upper + np.triu(upper, 1).T
    pinocchio.framesForwardKinematics(model, data, posture)
    x, y, z = data.oMf[model.getFrameId(scene.tool.link, pinocchio.BODY)].translation.tolist()
    shapes = {link.name: len(link.shapes) for link in scene.robot.links}
    return LoadedRobot(shapes, whole[np.ix_(columns, columns)], (x, y, z + scene.base_height_m))
