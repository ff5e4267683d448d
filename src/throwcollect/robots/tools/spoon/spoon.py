"""The throwing spoon: its boxes, its inertia, and where a ball rests in it.

Frame ``spoon_link``: origin at the handle's upper end, handle along -z, the cup beyond the handle's lower end with its
floor at x = 0, opening along +x.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.tools.spoon.spoon_config import SpoonConfig
from throwcollect.robots.tools.tool import Box, Tool, shift


class Spoon(Tool):
    """A handle and a cone of thin walls."""

    name = "spoon"

    _config: SpoonConfig

    @property
    def rim_radius_m(self) -> float:
        """Radius of the cone at its rim [m]."""
        return self._config.cup_rim_radius_m

    @property
    def depth_m(self) -> float:
        """Depth of the cone [m]."""
        return self._config.cup_depth_m

    @cached_property
    def boxes(self) -> tuple[Box, ...]:
        """The handle, and then the walls of the cup.

        The inner faces of the walls touch the cone from outside, so a ball that rests in the cup touches all of them.
        """
        config = self._config
        size = (config.handle_width_m, config.handle_width_m, config.handle_length_m)
        handle = Box(size, shift(z=-config.handle_length_m / 2))
        length, lean = self._slant
        middle = np.array([config.cup_depth_m / 2, (config.cup_rim_radius_m + config.cup_floor_radius_m) / 2, 0.0])
        inner_face = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0.0, 0.0, lean), middle)
        wall = inner_face * shift(y=config.wall_thickness_m / 2)
        # Narrower walls would leave gaps at the rim. Further down, these walls overlap, but only outside the cup.
        width = 2 * config.cup_rim_radius_m * math.tan(math.pi / config.cup_walls)
        turns = (
            pinocchio.SE3(pinocchio.rpy.rpyToMatrix(2 * math.pi * number / config.cup_walls, 0.0, 0.0), np.zeros(3))
            for number in range(config.cup_walls)
        )
        walls = (Box((length, config.wall_thickness_m, width), self._cup * turn * wall) for turn in turns)
        return (handle, *walls)

    def ball_seat(self, radius: float) -> tuple[float, float, float]:
        """Find the centre [m] of a ball that rests in the upright cup, in ``spoon_link``."""
        config = self._config
        floor, rim, depth = config.cup_floor_radius_m, config.cup_rim_radius_m, config.cup_depth_m
        if radius <= floor:
            problem = f"a ball of radius {radius} m falls through the floor of the cup"
            required = f"it must be above tool.cup_floor_radius_m = {floor}"
            raise ConfigError([Problem(f"{problem}; {required}", "ball.radius_m")])
        length, angle = self._slant
        # A ball on the walls touches them at a distance of `radius * cos(angle)` from the cup's axis. If that is beyond
        # the rim, or below the floor, the ball lies on the edge of the rim or of the floor instead.
        if radius * math.cos(angle) > rim:
            height = depth + math.sqrt(radius**2 - rim**2)
        elif radius * math.cos(angle) < floor:
            height = math.sqrt(radius**2 - floor**2)
        else:
            # Seen from the side, the wall is a straight line, and the centre is away from it by the radius.
            height = (radius * length - floor * depth) / (rim - floor)
        return (height, 0.0, float(self._cup.translation[2]))

    def way_out(self, radius: float, up: NDArray[np.float64]) -> float:
        """Find the slope of the lowest way on which a ball can leave the still cup [rad]; see `Tool.way_out`.

        For the upright cup, this is the tilt in the worst direction up to which it holds the ball.

        A ball that rests on the walls leaves between two of them, and touches both walls all the way, or neither. If
        the way climbs, the ball stays whatever its friction is, because it rolls. In 628 simulated postures with 14
        kinds of cup and ball, every ball that touched only the spoon stayed above 0.00 rad, and left below -0.01 rad.
        """
        config = self._config
        _, lean = self._slant
        # A ball that lies on the edge of floor or rim is held as if by walls along its surface.
        sine = min(max(math.cos(lean), config.cup_floor_radius_m / radius), config.cup_rim_radius_m / radius)
        # The way along the edge between two walls is less steep than the way up a wall.
        steepness = math.tan(math.asin(min(sine, 1.0))) * math.cos(math.pi / config.cup_walls)
        along, across, sideways = map(float, up)
        # One way out leads along each edge between two walls. Its direction has the lengths `steepness` along the axis
        # and 1 across it, so its component along `up` is the slope by which it climbs.
        climbs = []
        for number in range(config.cup_walls):
            turn = math.pi * (2 * number + 1) / config.cup_walls
            climbs.append(steepness * along + math.cos(turn) * across + math.sin(turn) * sideways)
        return math.asin(min(climbs) / math.hypot(steepness, 1.0))

    @property
    def _cup(self) -> pinocchio.SE3:
        # The handle reaches into the rim by a wall's thickness, so that handle and cup are one piece.
        config = self._config
        return shift(z=-(config.handle_length_m + config.cup_rim_radius_m - config.wall_thickness_m))

    @property
    def _slant(self) -> tuple[float, float]:
        """Length [m] of a wall from floor to rim, and its angle [rad] from the cup's axis."""
        flare = self._config.cup_rim_radius_m - self._config.cup_floor_radius_m
        return math.hypot(flare, self._config.cup_depth_m), math.atan2(flare, self._config.cup_depth_m)
