"""The claw: its boxes, its inertia, and where it holds a ball.

Frame ``claw_link``: origin at the palm's upper end, palm along -z, and at its lower end fingers along +x, apart by y.
So a ball between the open fingers leaves ahead when the arm brakes; while the arm speeds up, the palm pushes it.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError, Problem
from throwcollect.robots.tools.claw.claw_config import ClawConfig
from throwcollect.robots.tools.tool import Box, Tool, shift


class Claw(Tool):
    """A palm, a bar across its end, and two open fingers."""

    name = "claw"

    _config: ClawConfig

    @property
    def release_s(self) -> float:
        """Time at which it lets go of the ball [s]."""
        return self._config.release_s

    @property
    def rim_radius_m(self) -> float:
        """Half of the gap between the open fingers [m]."""
        return self._config.opening_m / 2

    @property
    def depth_m(self) -> float:
        """Length of the fingers [m]."""
        return self._config.finger_length_m

    @cached_property
    def boxes(self) -> tuple[Box, ...]:
        """The palm, the bar, and then the fingers."""
        config = self._config
        width, length, palm = config.finger_width_m, config.finger_length_m, config.palm_length_m
        aside, end = (config.opening_m + width) / 2, width / 2 - palm
        return (
            Box((width, width, palm), shift(z=-palm / 2)),
            Box((width, 2 * aside + width, width), shift(z=end)),
            *(Box((length, width, width), shift((width + length) / 2, y, end)) for y in (-aside, aside)),
        )

    def ball_seat(self, radius: float) -> tuple[float, float, float]:
        """Find the centre [m] of a ball that the fingers hold at their tips, in ``claw_link``."""
        config = self._config
        depth = config.finger_length_m - config.finger_width_m / 2
        room = min(config.opening_m / 2, depth)
        if radius >= room:
            problem = f"a ball of radius {radius} m has no room between the open fingers"
            required = f"it must be below {room:g} m, from tool.opening_m and tool.finger_length_m"
            raise ConfigError([Problem(f"{problem}; {required}", "ball.radius_m")])
        return (config.finger_width_m / 2 + depth, 0.0, config.finger_width_m / 2 - config.palm_length_m)

    def way_out(self, radius: float, up: NDArray[np.float64]) -> float:  # noqa: ARG002 - neither matters
        """Return the slope of a vertical way [rad], as the fingers hold the ball at any tilt; see `Tool.way_out`."""
        return math.pi / 2
