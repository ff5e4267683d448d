"""The kind of part `Tool`: a body in the robot's hand with a cup from which a ball is thrown."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.tool_config import ToolConfig
from throwcollect.members import explain_failure, is_own, load_part
from throwcollect.pinocchio_library import pinocchio

_Found = TypeVar("_Found")
_AXES = 3
_LENGTH = "a finite number above 0"


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
    """A tool; in the frame of its link, the cup must open along +x, and all else is up to the tool.

    Attributes:
        name: Name by which contacts with the tool are recorded, such as ``spoon``; its link is ``<name>_link``.
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
    def boxes(self) -> tuple[Box, ...]:
        """The boxes that the tool consists of."""

    @property
    @abstractmethod
    def inertia(self) -> pinocchio.Inertia:
        """Inertia of the tool, in its frame."""

    @property
    @abstractmethod
    def rim_radius_m(self) -> float:
        """Radius of the opening through which the ball leaves [m]."""

    @property
    @abstractmethod
    def depth_m(self) -> float:
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


class GuardedTool(Tool):
    """Stands in for a tool of another package, and refuses answers of a wrong kind with an error that names it."""

    def __init__(self, tool: Tool, member: str) -> None:
        self._tool = tool
        self._member = member
        self.name = self._ask("tell its name", lambda: tool.name, "name", "a text", _is_name)

    @property
    def mount(self) -> pinocchio.SE3:
        """Pose of the tool's frame in the hand."""
        return self._ask("tell its mount", lambda: self._tool.mount, "mount", "a pinocchio.SE3", _is_pose)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The boxes that the tool consists of."""
        wanted = "a tuple of at least one Box, with finite edges above 0 and a pinocchio.SE3"
        return tuple(self._ask("tell its boxes", lambda: self._tool.boxes, "boxes", wanted, _are_boxes))

    @property
    def inertia(self) -> pinocchio.Inertia:
        """Inertia of the tool, in its frame."""
        wanted = "a pinocchio.Inertia of a mass above 0"
        return self._ask("tell its inertia", lambda: self._tool.inertia, "inertia", wanted, _is_inertia)

    @property
    def rim_radius_m(self) -> float:
        """Radius of the opening [m]."""
        answer = self._ask("tell its radius", lambda: self._tool.rim_radius_m, "rim_radius_m", _LENGTH, _is_length)
        return float(answer)

    @property
    def depth_m(self) -> float:
        """Depth of the cup [m]."""
        return float(self._ask("tell its depth", lambda: self._tool.depth_m, "depth_m", _LENGTH, _is_length))

    def ball_seat(self, radius: float) -> tuple[float, float, float]:
        """Find the centre [m] of a ball that rests in the upright cup; see `Tool.ball_seat`.

        Raises:
            ConfigError: If the cup cannot hold such a ball.
            MemberError: If the tool fails.
        """
        x, y, z = self._ask(
            "seat the ball", lambda: self._tool.ball_seat(radius), "ball_seat", "three finite numbers", _is_point
        )
        return float(x), float(y), float(z)

    def way_out(self, radius: float, up: NDArray[np.float64]) -> float:
        """Find the slope of the lowest way out [rad]; see `Tool.way_out`.

        Raises:
            MemberError: If the tool fails.
        """
        return float(
            self._ask(
                "find the way out", lambda: self._tool.way_out(radius, up), "way_out", "a finite number", _is_number
            )
        )

    def _ask(
        self, doing: str, ask: Callable[[], _Found], name: str, wanted: str, check: Callable[[object], bool]
    ) -> _Found:
        """Ask for something, and check it.

        Raises:
            MemberError: If the tool raises an error, or the answer is not what is wanted.
        """
        with explain_failure("tools", self._member, doing):
            return _check_answer(ask(), name, wanted, check)


def tool_of(section: ToolConfig) -> Tool:
    """Make the tool that a section of a configuration describes.

    Raises:
        ConfigError: If the tool comes from another package, and cannot be imported.
        MemberError: If the tool comes from another package, and fails.
    """
    name = section.name
    kind = load_part("tools", name, section.implementation, Tool)
    with explain_failure("tools", name, "be made"):
        tool: Tool = kind(section)
    if is_own("tools", name):
        return tool
    return GuardedTool(tool, name)


def _check_answer(found: _Found, name: str, wanted: str, check: Callable[[object], bool]) -> _Found:
    """Make sure that an answer is what is wanted, and return it.

    Raises:
        TypeError: If it is not.
    """
    if not check(found):
        raise TypeError(f"{name} should be {wanted}, is {found!r}")
    return found


def _is_name(value: object) -> bool:
    return isinstance(value, str) and value != ""


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value)


def _is_length(value: object) -> bool:
    return isinstance(value, Real) and math.isfinite(value) and float(value) > 0


def _is_point(value: object) -> bool:
    return isinstance(value, tuple | list | np.ndarray) and len(value) == _AXES and all(map(_is_number, value))


def _is_pose(value: object) -> bool:
    return isinstance(value, pinocchio.SE3) and bool(np.isfinite(value.homogeneous).all())


def _is_inertia(value: object) -> bool:
    return isinstance(value, pinocchio.Inertia) and math.isfinite(value.mass) and value.mass > 0


def _are_boxes(value: object) -> bool:
    return isinstance(value, tuple | list) and len(value) > 0 and all(map(_is_box, value))


def _is_box(value: object) -> bool:
    if not (isinstance(value, Box) and _is_pose(value.placement)):
        return False
    return _is_point(value.size) and all(map(_is_length, value.size))
