"""The kind of part `Tool`: a body in the robot's hand with a cup from which a ball is thrown."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from throwcollect.config.schema import Config
from throwcollect.declared_types import check_properties, check_type
from throwcollect.errors import ConfigError
from throwcollect.members import explain_failure, is_own, load_part
from throwcollect.pinocchio_library import pinocchio

Positive = Annotated[float, Field(gt=0)]
_Numbers = tuple[float, ...]
_ORTHOGONAL = 1e-6
"""Largest difference between the identity matrix and a rotation matrix times its transpose."""


@dataclass(frozen=True)
class Box:
    """A box of a tool.

    Attributes:
        size: Edge lengths [m].
        placement: Pose of the box in the tool's frame; the frame of the box lies at its centre, along its edges.
    """

    size: tuple[Positive, Positive, Positive]
    placement: pinocchio.SE3


class Tool(ABC):
    """A tool; in the frame of its link, the cup must open along +x, and all else is up to the tool.

    Attributes:
        name: Name of the tool, as of its entry point, such as ``spoon``, by which contacts with it are recorded; its
            link is ``<name>_link``.
    """

    name: str

    @property
    def link(self) -> str:
        """Name of the tool's link in descriptions."""
        return f"{self.name}_link"

    @property
    @abstractmethod
    def mount(self) -> pinocchio.SE3:
        """Pose of the tool's frame in the hand that holds it."""

    @property
    @abstractmethod
    def boxes(self) -> Annotated[tuple[Box, ...], Field(min_length=1)]:
        """The boxes that the tool consists of."""

    @property
    @abstractmethod
    def inertia(self) -> pinocchio.Inertia:
        """Inertia of the tool, in its frame."""

    @property
    @abstractmethod
    def rim_radius_m(self) -> Positive:
        """Radius of the opening through which the ball leaves [m]."""

    @property
    @abstractmethod
    def depth_m(self) -> Positive:
        """Depth of the cup below the opening [m]."""

    @abstractmethod
    def ball_seat(self, radius: float) -> tuple[float, float, float]:
        """Find the centre [m] of a ball that rests in the upright cup, in the tool's frame.

        Args:
            radius: Radius of the ball [m].

        Raises:
            ConfigError: If the cup cannot hold such a ball.
        """

    @abstractmethod
    def way_out(self, radius: float, up: NDArray[np.float64]) -> float:
        """Find the slope of the lowest way on which a ball can leave the cup while the cup does not move.

        Args:
            radius: Radius of the ball [m].
            up: Unit vector against gravity in the tool's frame, shape ``(3,)``.

        Returns:
            Slope [rad]; above zero, the way climbs and the ball stays; below zero, it goes down.
        """


def tool_of(config: Config) -> Tool:
    """Make the tool that a configuration describes.

    Raises:
        ConfigError: If the tool comes from another package, and cannot be imported.
        MemberError: If the tool comes from another package, and fails or has something wrong.
    """
    name = config.tool.name
    kind = load_part("tools", name, config.tool.implementation, Tool)
    with explain_failure("tools", name, "be made"):
        tool: Tool = kind(config.tool)
        if not is_own("tools", name):
            # Contacts are recorded by the tool's own name, and judged by that in the configuration.
            check_type("name", getattr(tool, "name", None), Literal[name])
            _check(tool, config.ball.radius_m)
    return tool


def _check(tool: Tool, radius: float) -> None:
    """Make sure that a tool has all that is declared for tools, for a ball of this radius [m]."""
    check_properties(tool, Tool)
    check_type("inertia.mass", tool.inertia.mass, Positive)
    check_type("inertia.lever", tuple(tool.inertia.lever.tolist()), _Numbers)
    check_type("inertia.inertia", tuple(tool.inertia.inertia.ravel().tolist()), _Numbers)
    poses = {"mount": tool.mount, **{f"boxes.{index}.placement": box.placement for index, box in enumerate(tool.boxes)}}
    for name, pose in poses.items():
        check_type(f"{name}.translation", tuple(pose.translation.tolist()), _Numbers)
        if not np.allclose(pose.rotation @ pose.rotation.T, np.eye(3), rtol=0.0, atol=_ORTHOGONAL):
            raise TypeError(f"{name}.rotation: should be a rotation matrix, is {pose.rotation.tolist()}")
    # A tool refuses balls that it cannot hold; whoever asks for the seat reports that.
    with suppress(ConfigError):
        check_type("ball_seat", tool.ball_seat(radius), tuple[float, float, float])
        for up in (*np.eye(3), *-np.eye(3)):
            check_type("way_out", tool.way_out(radius, up), float)
