"""The paddle: its boxes and its inertia.

Frame ``paddle_link``: origin at the handle's upper end, handle along -z, the blade beyond the handle's lower end with
its faces along x.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from throwcollect.pinocchio_library import pinocchio
from throwcollect.tools.paddle.paddle_config import PaddleConfig
from throwcollect.tools.tool import Box, Tool, spread_mass


class Paddle(Tool):
    """A handle and a blade."""

    name = "paddle"

    def __init__(self, config: PaddleConfig) -> None:
        self._config = config

    @property
    def mount(self) -> pinocchio.SE3:
        """Pose of ``paddle_link`` in the hand."""
        return _shift(-self._config.mount_offset_m)

    @cached_property
    def boxes(self) -> tuple[Box, ...]:
        """The handle, and then the blade."""
        config = self._config
        width, handle, blade = config.handle_width_m, config.handle_length_m, config.blade_length_m
        return (
            Box((width, width, handle), _shift(-handle / 2)),
            Box((config.blade_thickness_m, config.blade_width_m, blade), _shift(-handle - blade / 2)),
        )

    @property
    def inertia(self) -> pinocchio.Inertia:
        """Inertia of the paddle in ``paddle_link``, with its mass spread evenly over the volume of its boxes."""
        return spread_mass(self._config.mass_kg, self.boxes)


def _shift(z: float) -> pinocchio.SE3:
    return pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, z]))
