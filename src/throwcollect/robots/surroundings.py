"""The bodies of a scene as values, from their sections of the configuration."""

from __future__ import annotations

from throwcollect.config.scene import AnyBody, BoxConfig, CylinderConfig
from throwcollect.config.schema import Config
from throwcollect.engines.body import HERE, BodyLink, LinkShape, Placement
from throwcollect.engines.engine import SceneBody


def bodies_of(config: Config) -> tuple[SceneBody, ...]:
    """Make the bodies that stand in the world of a trial: those of the scene, and those of the task."""
    sections = {**config.scene.bodies, **config.task.bodies}
    return tuple(_make_body(name, section) for name, section in sections.items())


def _make_body(name: str, section: AnyBody) -> SceneBody:
    size: tuple[float, ...] = (section.radius_m,) if not isinstance(section, BoxConfig) else tuple(section.size_m)
    if isinstance(section, CylinderConfig):
        size = (section.radius_m, section.length_m)
    link = BodyLink(name, shapes=(LinkShape(section.shape, size, HERE),))
    (x, y, z), (roll, pitch, yaw) = section.position_m, section.rpy_rad
    return SceneBody(link, Placement((x, y, z), (roll, pitch, yaw)), section.friction, section.restitution)
