"""The kind of part `Tool`: a body in the robot's hand which throws what lies in it or is held, or hits other bodies."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.schema import Config
from throwcollect.config.tool_config import ToolConfig
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.errors import ConfigError, Problem
from throwcollect.members import explain_failure, load_part
from throwcollect.reproducible_math import add_up


@dataclass(frozen=True)
class Box:
    """A box of a tool.

    Attributes:
        size: Edge lengths [m].
        placement: Pose of the box in the tool's frame; the frame of the box lies at its centre, along its edges.
    """

    size: tuple[float, float, float]
    placement: pinocchio.SE3


class Tool(ABC):
    """A tool; in the frame of its link, a cup must open along +x, and all else is up to the tool.

    Opening, depth, seat and way out are those of tools in which an object can lie; by default, a tool holds none.

    Mount and inertia follow from two keys by default: ``mount_offset_m``, and ``mass_kg``.

    Args:
        config: The tool's section of the configuration.

    Attributes:
        name: Name of the tool, as of its entry point, such as ``spoon``, by which contacts with it are recorded; its
            link is ``<name>_link``.
    """

    name: str

    def __init__(self, config: Any) -> None:
        self._config = config

    @property
    def release_s(self) -> float | None:
        """Time since the start of a trial up to which the tool holds the ball [s]; None if the ball lies in it."""
        return None

    @property
    def link(self) -> str:
        """Name of the tool's link in descriptions."""
        return f"{self.name}_link"

    @property
    def mount(self) -> pinocchio.SE3:
        """Pose of the tool's frame in the hand that holds it; by default, the tool is shifted along -z of the hand."""
        return shift(z=-self._config.mount_offset_m)

    @property
    @abstractmethod
    def boxes(self) -> tuple[Box, ...]:
        """The boxes that the tool consists of, at least one."""

    @property
    def inertia(self) -> pinocchio.Inertia:
        """Inertia of the tool, in its frame; by default, the mass is spread evenly over the volume of the boxes."""
        return spread_mass(self._config.mass_kg, self.boxes)

    @property
    def rim_radius_m(self) -> float:
        """Radius of the opening through which the object leaves [m]; 0 if the tool holds none."""
        return 0.0

    @property
    def depth_m(self) -> float:
        """Depth of the cup below the opening [m]; 0 likewise."""
        return 0.0

    def ball_seat(self, radius: float) -> tuple[float, float, float]:  # noqa: ARG002 - tools that hold nothing
        """Find the centre [m] of an object that rests in the upright cup, in the tool's frame.

        Args:
            radius: Radius of the sphere around the object [m].

        Raises:
            ConfigError: If the tool cannot hold such an object.
        """
        raise self._refuse()

    def way_out(self, radius: float, up: NDArray[np.float64]) -> float:  # noqa: ARG002 - tools that hold nothing
        """Find the slope of the lowest way on which an object can leave the cup while the cup does not move.

        Args:
            radius: Radius of the sphere around the object [m].
            up: Unit vector against gravity in the tool's frame, shape ``(3,)``.

        Returns:
            Slope [rad]; above zero, the way climbs and the object stays; below zero, it goes down.

        Raises:
            ConfigError: If the tool holds no object at all.
        """
        raise self._refuse()

    def _refuse(self) -> ConfigError:
        """Make the error for a configuration in which the object starts in a tool that holds none."""
        what = "set `object` to a body that lies elsewhere, or a task that has one, such as slide"
        return ConfigError([Problem(f"the {self.name} holds no object; {what}", "tool.name")])


def shift(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> pinocchio.SE3:
    """Make the pose of a frame that is shifted [m], and not turned."""
    return pinocchio.SE3(np.eye(3), np.array([x, y, z]))


def spread_mass(mass_kg: float, boxes: Sequence[Box]) -> pinocchio.Inertia:
    """Compute the inertia of a mass [kg] that is spread evenly over the volume of boxes."""
    # `add_up` is used, because from Python 3.12 on `sum` rounds in another way, and the bytes of a throw depend on
    # the inertia.
    density = mass_kg / add_up(math.prod(box.size) for box in boxes)
    total = pinocchio.Inertia.Zero()
    for box in boxes:
        total += box.placement.act(pinocchio.Inertia.FromBox(density * math.prod(box.size), *box.size))
    return total


def tool_of(config: Config) -> Tool:
    """Make the tool that a configuration describes; see `make_tool`."""
    return make_tool(config.tool)


def make_tool(section: ToolConfig) -> Tool:
    """Make the tool of a section.

    Raises:
        ConfigError: If the tool comes from another package, and cannot be imported.
        MemberError: If the tool comes from another package, and fails.
    """
    kind = load_part("tools", section.name, section.implementation)
    with explain_failure("tools", section.name, "be made"):
        tool: Tool = kind(section)
    return tool
