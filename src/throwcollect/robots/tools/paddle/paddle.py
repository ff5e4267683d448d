"""The paddle: its boxes and its inertia.

Frame ``paddle_link``: origin at the handle's upper end, handle along -z, the blade beyond the handle's lower end with
its faces along x.
"""

from __future__ import annotations

from functools import cached_property

from throwcollect.robots.tools.paddle.paddle_config import PaddleConfig
from throwcollect.robots.tools.tool import Box, Tool, shift


class Paddle(Tool):
    """A handle and a blade."""

    name = "paddle"

    _config: PaddleConfig

    @cached_property
    def boxes(self) -> tuple[Box, ...]:
        """The handle, and then the blade."""
        config = self._config
        width, handle, blade = config.handle_width_m, config.handle_length_m, config.blade_length_m
        return (
            Box((width, width, handle), shift(z=-handle / 2)),
            Box((config.blade_thickness_m, config.blade_width_m, blade), shift(z=-handle - blade / 2)),
        )
