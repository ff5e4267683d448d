"""The kind of part `Robot`: its joints and their limits, the controllers that command them, and its description."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.engines.body import HERE, Placement
from throwcollect.errors import ConfigError
from throwcollect.members import explain_failure
from throwcollect.robots.urdf import PACKAGE, Urdf, locate_mesh, read_urdf, read_xml


# Robots are keys of caches. With `eq`, a robot would be hashed by its fields, but mappings among them have no hash.
@dataclass(frozen=True, eq=False)
class Robot:
    """A robot with a fixed base whose joints are revolute or prismatic, and the hand that holds the tool.

    Attributes:
        name: Name of the robot in configurations, such as ``talos``.
        title: Name of the robot in sentences, such as ``Talos``.
        controllers: Joint trajectory controller of each limb and its joints, in order; each joint has one. Their
            names are such as ROS allows for nodes.
        share: Returns the directory that ``package://`` paths of the description are relative to; raises `ConfigError`
            if the package that brings this directory is not installed.
        package: Package of ``package://`` paths whose files lie in that directory itself.
        urdf: Path of the URDF in that directory, or an absolute path.
        srdf: Path of the SRDF in that directory, or an absolute path. The SRDF lists links that may overlap, and holds
            the posture at rest.
        rest: Name of the SRDF's posture that joints have unless a configuration has another one.
        hand: Link that the tool is fixed to: the spoon's handle lies along -z of `tool_pose` in it, and the cup opens
            along +x.
        open_hand: Prefix of the names of links that have no collision shapes, because the tool reaches into them.
        tool_pose: Pose of the hand's frame, in which the tool is mounted, in that link.
        holding: Links that hold the tool and are not checked for collisions with it: names, or prefixes of names that
            end with ``_``.
        rigid: For each group of links that only mimic joints move, the prefix of the links' names. Links of a group are
            not checked for collisions with each other.
        sliding: Joints that are prismatic, whose positions are in metres and efforts in newtons.
        goal_tolerance_rad: Largest distance of each joint from the end of a trajectory whose goal has no tolerances
            of its own; 0 is not checked.
        goal_time_s: Longest time after the end of such a trajectory until the joint is within that distance; 0 waits
            for ever.
        stopped_velocity_radps: Largest velocity that the robot's controllers take for standing still.
    """

    name: str
    title: str
    controllers: Mapping[str, tuple[str, ...]]
    share: Callable[[], Path]
    urdf: str
    srdf: str
    rest: str
    hand: str
    package: str = ""
    tool_pose: Placement = HERE
    open_hand: str = ""
    holding: tuple[str, ...] = ()
    rigid: tuple[str, ...] = ()
    sliding: frozenset[str] = frozenset()
    goal_tolerance_rad: float = 0.0
    goal_time_s: float = 0.0
    stopped_velocity_radps: float = 0.01

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """All joints that are commanded, in the order of every joint state and joint array."""
        return tuple(joint for joints in self.controllers.values() for joint in joints)

    def controller_of(self, joint: str) -> str:
        """Return the name of the controller that commands a joint.

        Raises:
            KeyError: If the robot has no such joint.
        """
        for controller, joints in self.controllers.items():
            if joint in joints:
                return controller
        raise KeyError(joint)

    def unit_of(self, joint: str) -> str:
        """Return the unit of the positions of a joint: ``rad`` or ``m``."""
        return "m" if joint in self.sliding else "rad"

    def holds(self, link: str) -> bool:
        """Whether a link holds the tool."""
        return any(link == each or (each.endswith("_") and link.startswith(each)) for each in self.holding)

    def locate(self, url: str) -> Path:
        """Find the file of a mesh by its path or URL in the URDF.

        Raises:
            ConfigError: If it is a URL of another scheme than ``file`` and ``package``.
        """
        if self.package and url.startswith(own := f"{PACKAGE}{self.package}/"):
            return self.directory / url.removeprefix(own)
        return locate_mesh(url, self.urdf_path.parent, self.directory)

    @property
    def directory(self) -> Path:
        """Directory that `share` returns.

        Raises:
            ConfigError: If the description is not installed.
            MemberError: If the robot comes from another package, and its function fails.
        """
        with explain_failure("robots", self.name, "find its files"):
            return self.share()

    @property
    def urdf_path(self) -> Path:
        """Path of the URDF.

        Raises:
            ConfigError: If the description is not installed.
        """
        return self.directory / self.urdf

    @property
    def srdf_path(self) -> Path:
        """Path of the SRDF.

        Raises:
            ConfigError: If the description is not installed.
        """
        return self.directory / self.srdf

    @cached_property
    def xml(self) -> ElementTree.Element:
        """Materials, links and joints of the URDF, without the collision shapes of the hand that holds the tool.

        Callers must not change it.

        Raises:
            ConfigError: If it cannot be read.
        """
        source = read_xml(self.urdf_path)
        description = ElementTree.Element(source.tag, name=source.get("name", self.name))
        for kind in ("material", "link", "joint"):
            description.extend(source.findall(kind))
        for link in description.iter("link"):
            if self.open_hand and link.get("name", "").startswith(self.open_hand):
                for shape in link.findall("collision"):
                    link.remove(shape)
        return description

    @cached_property
    def description(self) -> Urdf:
        """The URDF, without the collision shapes of the hand that holds the tool.

        Raises:
            ConfigError: If it is not a URDF of this robot, or contradicts itself.
        """
        path = self.urdf_path
        urdf = read_urdf(self.xml, str(path), find_mesh=self.locate)
        if missing := [name for name in self.joints if name not in urdf.joints]:
            raise ConfigError(f"{path}: joint {missing[0]} is missing")
        if self.hand not in urdf.links:
            raise ConfigError(f"{path}: link {self.hand} is missing")
        wanted = {name: "prismatic" if name in self.sliding else "revolute" for name in self.joints}
        found = {joint.name: f"mimics {joint.mimics}" if joint.mimics else joint.kind for joint in urdf.model.joints}
        moving = [joint.name for joint in urdf.model.moving]
        if wrong := [name for name in (*moving, *self.joints) if found[name] != wanted.get(name)]:
            raise ConfigError(
                f"{path}: joints that move should be those of controllers of {self.title}, and revolute, or "
                f"prismatic if they slide: {', '.join(f'{name} ({found[name]})' for name in dict.fromkeys(wrong))}",
                hint='make others type="fixed" in a copy of the URDF, and give a continuous joint a <limit> with ends',
            )
        return urdf

    @cached_property
    def rest_posture(self) -> Mapping[str, float]:
        """Angle [rad] of each joint in the posture at rest, in the order of `joints`; 0 for joints that the SRDF omits.

        Raises:
            ConfigError: If the SRDF cannot be read or has no such posture.
        """
        path = self.srdf_path
        state = read_xml(path).find(f"group_state[@name='{self.rest}']")
        if state is None:
            raise ConfigError(f"{path}: no group_state {self.rest}")
        angles = {joint.get("name"): joint.get("value", "0") for joint in state.iter("joint")}
        try:
            posture = {name: float(angles.get(name, "0")) for name in self.joints}
        except ValueError as error:
            raise ConfigError(f"{path}: group_state {self.rest} is not readable: {error}") from error
        if not all(map(math.isfinite, posture.values())):
            raise ConfigError(f"{path}: group_state {self.rest} has an angle that is not finite")
        return MappingProxyType(posture)


@dataclass(frozen=True)
class JointLimits:
    """Limits and damping of the joints of a robot, each of shape ``(n_joints,)`` in the order of `Robot.joints`.

    Attributes:
        lower: Lowest position [rad].
        upper: Highest position [rad].
        velocity: Highest speed [rad/s].
        effort: Highest torque [Nm].
        damping: Viscous friction [Nms/rad].
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    damping: NDArray[np.float64]


@cache
def joint_limits(robot: Robot) -> JointLimits:
    """Read the limits of the joints of a robot."""
    joints = [robot.description.joints[name] for name in robot.joints]
    table = np.array([(*joint.limits, joint.damping) for joint in joints if joint.limits is not None])
    # The result is cached, so all callers have the same arrays, and none may write to them.
    table.flags.writeable = False
    return JointLimits(*table.T)


def shares_of(values: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute magnitudes over their limits [-], of the shape of the values, ``(..., n_joints)``.

    A limit may be 0, because a URDF may have such limits for joints that never move. Then the share of a value of 0 is
    0, and the share of any other value is infinite.
    """
    with np.errstate(divide="ignore", over="ignore"):
        shares: NDArray[np.float64] = np.divide(np.abs(values), limits, out=np.zeros_like(values), where=values != 0)
    return shares
