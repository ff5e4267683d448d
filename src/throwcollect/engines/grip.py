"""An object that a tool holds: the same arithmetic in every engine that simulates contacts.

The object is moved to its seat after each step, as a constraint of the engine's solver would be soft, and of another
softness in each engine. While it is held, a link that is fixed to the tool has its mass, so that the arm bears it.
"""

from __future__ import annotations

from dataclasses import replace

from throwcollect.engines.body import HERE, BodyJoint, BodyLink, BodyModel, LinkInertia, Placement, Vector
from throwcollect.engines.engine import BodyState, Quaternion, State, ToolLink, object_in

HELD_LINK = "held object"

ANY_INERTIA = LinkInertia(1.0, HERE, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
"""Inertia of a link for which an engine sets another one, or that never moves."""


def carry(held: BodyState, centre: Vector, turn: Quaternion, hz: float) -> BodyState:
    """Move a held object on by one step; its velocities are those that lead there, as in free flight.

    Args:
        held: The object before the step.
        centre: Its centre after the step in world [m].
        turn: Orientation of the tool's link after the step, which is that of the object, too.
        hz: Steps per simulated second.
    """
    (x, y, z), (nx, ny, nz) = held.position, centre
    (a, b, c, w), (i, j, k, r) = held.orientation_xyzw, turn
    # The vector part of the rotation from one orientation to the other; its length is the sine of half its angle.
    p, q, s = w * i - r * a + b * k - c * j, w * j - r * b + c * i - a * k, w * k - r * c + a * j - b * i
    # Two terms of the arcsine's series are exact to 1e-9 for 0.02 rad in a step, which are 10 rad/s at 500 Hz.
    factor = 2 * hz * (1 + (p * p + q * q + s * s) / 6)
    if a * i + b * j + c * k + w * r < 0:
        factor = -factor
    velocity = (nx - x) * hz, (ny - y) * hz, (nz - z) * hz
    return BodyState(centre, turn, velocity, (p * factor, q * factor, s * factor))


def find_held(tool: ToolLink, state: State) -> BodyState | None:
    """Find the object that a tool holds in a state; None if it holds none."""
    return object_in(state.sample) if tool.seat is not None and tool.name in state.touching else None


def add_held_link(robot: BodyModel, tool: ToolLink) -> BodyModel:
    """Add the link that has the mass of the held object to a robot, unless its tool holds none."""
    if tool.seat is None:
        return robot
    joint = BodyJoint(HELD_LINK, "fixed", tool.link, HELD_LINK, Placement(tool.seat))
    return replace(robot, links=(*robot.links, BodyLink(HELD_LINK, ANY_INERTIA)), joints=(*robot.joints, joint))
