"""Finds what is odd about a robot's description: it can be simulated, but is probably not what its user means."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from throwcollect.robots.derived import Postures
from throwcollect.robots.robot import Robot, joint_limits

_FEW = 3
_DRAWS = 300
_LEAST_REACH_M, _MOST_REACH_M = 0.1, 4.0
_LEAST_KG = 1e-4
_TILT_RAD = math.radians(14)


def find_placeholders(robot: Robot) -> Iterator[str]:
    """Find limits that are the same round number for all joints of the arm, as exporters of descriptions write them."""
    limits = joint_limits(robot)
    for values, words, unit in ((limits.velocity, "speed", "rad/s"), (limits.effort, "effort", "Nm")):
        if len(values) >= _FEW and np.ptp(values) == 0 and values[0] == round(values[0]):
            yield (
                f"{robot.title}: the {words} limit of every joint is {values[0]:g} {unit}, which looks like a "
                "place-holder; robot.limits takes those of the real robot"
            )


def find_oddities(robot: Robot) -> Iterator[str]:
    """Describe what is odd, a sentence each."""
    yield from find_placeholders(robot)
    links = robot.description.links.values()
    if not any(link.shapes for link in links):
        yield "no link has a collision shape, so that no collision is found"
    masses = {joint.child for joint in robot.description.model.moving}
    for link in links:
        if link.name in masses and link.inertia is not None and link.inertia.mass_kg < _LEAST_KG:
            yield f"link {link.name} has a mass of {link.inertia.mass_kg:g} kg"
    postures = Postures(robot)
    home = np.array([robot.rest_posture[joint] for joint in postures.joints])
    for one, other in postures.list_overlapping(home):
        yield f"{one} and {other} overlap in the posture at rest"
    tilt = math.acos(min(1.0, max(-1.0, postures.find_uprightness(home))))
    if tilt > _TILT_RAD:
        degrees = math.degrees(tilt)
        yield f"the posture at rest tilts the tool by {degrees:.0f}°; a task needs a start that holds the ball"
    reach = max(np.linalg.norm(postures.place_tool(postures.draw()).translation) for _ in range(_DRAWS))
    if not _LEAST_REACH_M < reach < _MOST_REACH_M:
        yield f"the tool is at most {reach:.3g} m from the base: are its lengths in metres?"
