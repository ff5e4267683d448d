"""The bodies of a scene as values, from their sections of the configuration."""

from __future__ import annotations

from throwcollect.config.scene import AnyBody, BoxConfig, CylinderConfig
from throwcollect.config.schema import Config
from throwcollect.engines.body import HERE, BodyLink, LinkInertia, LinkShape, Placement, moments_of
from throwcollect.engines.engine import SceneBody


def bodies_of(config: Config) -> tuple[SceneBody, ...]:
    """Make the bodies that stand in the world of a trial: those of the scene, and those of the task."""
    sections = {**config.scene.bodies, **config.task.bodies}
    return tuple(_make_body(name, section) for name, section in sections.items())


def _make_body(name: str, section: AnyBody) -> SceneBody:
    size: tuple[float, ...] = (section.radius_m,) if not isinstance(section, BoxConfig) else tuple(section.size_m)
    if isinstance(section, CylinderConfig):
        size = (section.radius_m, section.length_m)
    inertia = None
    if section.mass_kg is not None:
        x, y, z = moments_of(section.shape, size, section.mass_kg)
        inertia = LinkInertia(section.mass_kg, HERE, (x, 0.0, 0.0, y, 0.0, z))
    link = BodyLink(name, inertia, (LinkShape(section.shape, size, HERE),))
    (x, y, z), (roll, pitch, yaw) = section.position_m, section.rpy_rad
    restitution = (1.0 if inertia is None else 0.0) if section.restitution is None else section.restitution
    return SceneBody(link, Placement((x, y, z), (roll, pitch, yaw)), section.friction, restitution)
