"""Derives what a URDF does not say: links that may overlap, and a posture in which the hand holds the tool upright."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.engines.body import to_text
from throwcollect.engines.pinocchio_library import pinocchio
from throwcollect.robots.clearance import read_shapes
from throwcollect.robots.imported import HOME, make_error
from throwcollect.robots.joint_model import joint_model, pose_of
from throwcollect.robots.robot import Robot
from throwcollect.robots.urdf import read_xml
from throwcollect.wording import suggest

_POSTURES = 150
_ALWAYS = 0.95
"""Links that overlap in this share of random postures do so by their shape, and not by the posture."""
_DRAWS = 20_000
_UPRIGHT = math.cos(math.radians(14))
_SEED = 0


class Postures:
    """Random postures of a robot, and which of its links overlap in them.

    Args:
        robot: The robot; if it has an SRDF, the links that it lets overlap are not looked at.

    Attributes:
        model: All joints, in whose order postures are.
        joints: Their names.
        allowed: Links that may overlap, by pairs in alphabetical order; more may be added.
        carrying: Numbers of the joints that carry the hand.
    """

    def __init__(self, robot: Robot) -> None:
        self.model = joint_model(robot)
        self.joints = list(self.model.names)[1:]
        self._data = self.model.createData()
        self.geometry = pinocchio.GeometryModel(read_shapes(robot))
        self._placed = self.geometry.createData()
        self._links = [self.model.frames[shape.parentFrame].name for shape in self.geometry.geometryObjects]
        self._pairs = [(pair.first, pair.second) for pair in self.geometry.collisionPairs]
        self._hand, self._tool = self.model.getFrameId(robot.hand, pinocchio.BODY), pose_of(robot.tool_pose)
        self.carrying = [joint - 1 for joint in self.model.supports[self.model.frames[self._hand].parentJoint] if joint]
        self.allowed: set[tuple[str, str]] = set()
        # While a robot is imported, it has no SRDF, and no posture at rest.
        self._rest = None
        if robot.srdf_path.is_file():
            self._rest = np.array([robot.rest_posture[joint] for joint in self.joints])
        self._random = np.random.default_rng(_SEED)

    def draw(self) -> NDArray[np.float64]:
        """Draw a posture within the limits, and within half a turn, in the order of the model [rad].

        Joints that do not carry the hand are at rest, where the robot has a posture at rest.
        """
        lower = np.maximum(self.model.lowerPositionLimit, -math.pi)
        upper = np.minimum(self.model.upperPositionLimit, math.pi)
        posture = lower + (upper - lower) * self._random.random(self.model.nq)
        if self._rest is None:
            return np.asarray(posture)
        drawn = self._rest.copy()
        drawn[self.carrying] = posture[self.carrying]
        return drawn

    def find_overlaps(self, posture: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Find the pairs of shapes that overlap in a posture."""
        pinocchio.computeCollisions(self.model, self._data, self.geometry, self._placed, posture, False)
        return np.array([result.isCollision() for result in self._placed.collisionResults], bool)

    def allow_close(self) -> None:
        """Allow pairs of links to overlap that are neighbours, or that overlap in nearly all postures."""
        hits = np.zeros(len(self._pairs), int)
        for _ in range(_POSTURES):
            hits += self.find_overlaps(self.draw())
        parents, shapes = self.model.parents, self.geometry.geometryObjects
        for (first, second), count in zip(self._pairs, hits, strict=True):
            one, other = shapes[first].parentJoint, shapes[second].parentJoint
            if one == other or parents[one] == other or parents[other] == one or count > _ALWAYS * _POSTURES:
                self.allowed.add(self._name(first, second))

    def list_overlapping(self, posture: NDArray[np.float64]) -> list[tuple[str, str]]:
        """List the pairs of links that overlap in a posture, without those that may."""
        found = {self._name(*self._pairs[index]) for index in np.flatnonzero(self.find_overlaps(posture))}
        return sorted(found - self.allowed)

    def place_tool(self, posture: NDArray[np.float64]) -> pinocchio.SE3:
        """Compute the pose in which the hand holds the tool, in the base."""
        pinocchio.framesForwardKinematics(self.model, self._data, posture)
        return self._data.oMf[self._hand] * self._tool

    def find_uprightness(self, posture: NDArray[np.float64]) -> float:
        """Compute the cosine of the angle between the tool's opening and the vertical."""
        return float(self.place_tool(posture).rotation[2, 0])

    def find_upright(self, count: int = 1) -> tuple[list[NDArray[np.float64]], float]:
        """Search postures that hold a ball in the tool and are clear.

        Returns:
            At most as many as asked for, in the order of the model [rad], and the smallest angle to the vertical
            found [rad].
        """
        found, best = [], -1.0
        for _ in range(_DRAWS):
            posture = self.draw()
            upright = self.find_uprightness(posture)
            best = max(best, upright)
            if upright > _UPRIGHT and not self.list_overlapping(posture):
                found.append(posture)
                if len(found) == count:
                    break
        return found, math.acos(min(best, 1.0))

    def _name(self, first: int, second: int) -> tuple[str, str]:
        one, other = sorted((self._links[first], self._links[second]))
        return one, other


def derive(robot: Robot, section: DescribedRobotConfig) -> tuple[str, str]:
    """Write the SRDF of an imported robot, and say where its contents come from.

    Args:
        robot: The robot; its SRDF does not exist yet.
        section: The section by which it was imported.
    """
    source = None if section.srdf is None else read_xml(Path(section.srdf))
    postures = Postures(robot)
    postures.allow_close()
    pairs = f"neighbours and links that overlap in {_ALWAYS:.0%} of {_POSTURES} random postures"
    if source is not None:
        postures.allowed |= set(_read_allowed(source, set(robot.description.links)))
        pairs = f"those of {Path(section.srdf or '').name}, {pairs}"
    home, origin = _find_home(robot, section, source, postures)
    for joint, position in home.items():
        lower, upper, *_ = robot.description.joints[joint].limits or (0.0, 0.0)
        if not lower <= position <= upper:
            sentence = f"{position:g} is beyond the limits of {joint}, {lower:g} to {upper:g}; from: {origin}"
            raise make_error("home", sentence)
    root = ElementTree.Element("robot", name=robot.name)
    state = ElementTree.SubElement(root, "group_state", name=HOME, group="all")
    for joint, position in home.items():
        ElementTree.SubElement(state, "joint", name=joint, value=repr(float(position)))
    for one, other in sorted(postures.allowed):
        ElementTree.SubElement(root, "disable_collisions", link1=one, link2=other, reason="derived")
    return to_text(root), f"posture at rest: {origin}; links that may overlap: {pairs}"


def _read_allowed(source: ElementTree.Element, links: set[str]) -> Iterator[tuple[str, str]]:
    for pair in source.iter("disable_collisions"):
        one, other = sorted((pair.get("link1", ""), pair.get("link2", "")))
        if one in links and other in links:
            yield one, other


def _find_home(
    robot: Robot,
    section: DescribedRobotConfig,
    source: ElementTree.Element | None,
    postures: Postures,
) -> tuple[Mapping[str, float], str]:
    """Find the posture at rest, and say where it comes from."""
    given = section.home
    if isinstance(given, dict):
        if unknown := [joint for joint in given if joint not in robot.joints]:
            sentence = f"{robot.name} has no joint {unknown[0]!r}{suggest(unknown[0], robot.joints)}"
            raise make_error(f"home.{unknown[0]}", sentence)
        return {joint: given.get(joint, 0.0) for joint in robot.joints}, "given"
    states = {} if source is None else {each.get("name", ""): each for each in source.iter("group_state")}
    if given != "auto":
        if given not in states:
            known = f"; robot.srdf has {', '.join(states) or 'none'}"
            raise make_error("home", f"no group_state {given!r}{known}")
        return _read_state(robot, states[given]), f"{given} of the SRDF"
    for name, state in states.items():
        if {joint.get("name") for joint in state.iter("joint")} >= set(robot.joints):
            return _read_state(robot, state), f"{name} of the SRDF"
    found, angle = postures.find_upright()
    if not found:
        sentence = f"no posture holds the tool upright and is clear: the best angle is {math.degrees(angle):.0f}°"
        raise make_error("", sentence, hint="turn the hand by robot.tool_pose, or give robot.home")
    angles = dict(zip(postures.joints, np.round(found[0], 4).tolist(), strict=True))
    return {joint: angles[joint] for joint in robot.joints}, "searched, holds the ball"


def _read_state(robot: Robot, state: ElementTree.Element) -> Mapping[str, float]:
    values = {joint.get("name"): float(joint.get("value", "0")) for joint in state.iter("joint")}
    return {joint: values.get(joint, 0.0) for joint in robot.joints}
