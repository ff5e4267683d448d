"""Cleans a foreign URDF: joints that controllers command stay, all others are fixed, and meshes become hulls."""

from __future__ import annotations

import copy
import hashlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

from throwcollect.config.robot_config import ChainConfig, DescribedRobotConfig, LimitsConfig
from throwcollect.engines.body import BodyJoint, BodyModel, LinkShape, to_text
from throwcollect.engines.mesh import Mesh
from throwcollect.errors import ConfigError
from throwcollect.members import load_member, names_of
from throwcollect.robots.imported import SRDF, URDF, find_mesh, make_error, package_of
from throwcollect.robots.joint_model import move_joint
from throwcollect.robots.urdf import PACKAGE, read_urdf, read_xml
from throwcollect.wording import suggest

_TURN = 6.283185307179586
_LARGEST_M = 10.0
"""No part of a robot is larger; meshes in millimetres are."""
_LARGE_BYTES = 100_000
_HOLDING = 3
"""So many links before the flange hold the tool."""
_KNOWN_CONTROLLERS = (
    (r"panda|fr3", "{}_arm_controller"),  # moveit_resources and franka_ros2
    (r"ur\d+e?", "scaled_joint_trajectory_controller"),  # ur_robot_driver
    (r"(?:x|lite)arm\d|uf_robot", "xarm7_traj_controller"),  # xarm_ros2
    (r"tiago", "arm_controller"),  # tiago_robot
    (r"gen3|kinova", "joint_trajectory_controller"),  # ros2_kortex
)
_UNNAMED = "arm_controller"


class Cleaning:
    """A robot on its way from its makers' URDF to the files of an import.

    Args:
        section: The section by which it is imported.
        path: Its URDF.

    Attributes:
        notes: Where each key of the complete section comes from.
        files: Contents of the meshes, by the names of the files.
    """

    def __init__(self, section: DescribedRobotConfig, path: Path) -> None:
        self._section, self._path = section, path
        self._find_mesh = partial(find_mesh, urdf=path, packages=section.packages)
        self._source = read_xml(path)
        self.notes: dict[str, str] = {}
        self.files: dict[str, bytes] = {}
        self.urdf = read_urdf(self._source, str(path), find_mesh=self._find_mesh)
        self.name = self._find_name()
        self._require("link", section.flange, self.urdf.links, "flange")
        self._above = {joint.child: joint for joint in self.urdf.model.joints}
        self.chain = self._find_chain(section.flange)
        self.controllers = self._find_controllers()
        self._moving = {name for names in self.controllers.values() for name in names}

    def _find_name(self) -> str:
        given = self._section.name
        name = given or re.sub(r"[^a-z0-9_-]+", "_", self.urdf.model.name.lower()).strip("_-") or "robot"
        self.notes["name"] = "given" if given else "the name in the URDF"
        member = load_member("robots", name) if name in names_of("robots") else self._section
        if not (isinstance(member, DescribedRobotConfig) and (given or member.urdf == self._section.urdf)):
            raise make_error("name", f"{name} is the name of an installed robot; give another one")
        return name

    def _require(self, kind: str, name: str, known: Collection[str], key: str) -> None:
        if name not in known:
            raise make_error(key, f"{self._path} has no {kind} {name!r}{suggest(name, known)}")

    def _find_chain(self, tip: str, base: str | None = None) -> list[BodyJoint]:
        """List the joints from the root, or from a link, to a link."""
        chain: list[BodyJoint] = []
        link = tip
        while link != base and link in self._above:
            chain.insert(0, self._above[link])
            link = self._above[link].parent
        if base is not None and link != base:
            raise make_error("controllers", f"no joints lead from the link {base} to {tip}")
        return chain

    def _find_controllers(self) -> dict[str, list[str]]:
        section, joints = self._section, self.urdf.joints
        for key, names in (("fixed", section.fixed), ("limits", section.limits)):
            for name in names:
                self._require("joint", name, joints, f"{key}.{name}")
        if section.controllers is None:
            found = [joint.name for joint in self.chain if self._can_move(joint) and joint.name not in section.fixed]
            if not found:
                raise make_error("flange", f"no joint moves {section.flange}")
            kind = f"{self.urdf.model.name} {self.name}".lower()
            known = (name for pattern, name in _KNOWN_CONTROLLERS if re.search(pattern, kind))
            name = next(known, _UNNAMED).format(self.name)
            self.notes["controllers"] = f"the joints between base and flange; {name} " + (
                "is made up" if name == _UNNAMED else "is its name in the robot's ROS 2 software"
            )
            return {name: found}
        self.notes["controllers"] = "given"
        given = {name: self._list_joints(name, each) for name, each in section.controllers.items()}
        named = [joint for each in given.values() for joint in each]
        if not all(given.values()) or not {joint.name for joint in self.chain} & set(named):
            raise make_error("controllers", f"each should have joints, and some should move {section.flange}")
        if twice := [joint for joint in named if named.count(joint) > 1]:
            raise make_error("controllers", f"the joint {twice[0]} is there twice")
        if both := [joint for joint in named if joint in section.fixed]:
            raise make_error(f"fixed.{both[0]}", "a controller commands this joint")
        return given

    def _list_joints(self, controller: str, given: list[str] | ChainConfig) -> list[str]:
        key, joints = f"controllers.{controller}", self.urdf.joints
        if isinstance(given, ChainConfig):
            for link in given.chain:
                self._require("link", link, self.urdf.links, key)
            base, tip = given.chain
            return [joint.name for joint in self._find_chain(tip, base) if self._can_move(joint)]
        for name in given:
            self._require("joint", name, joints, key)
            if not self._can_move(joint := joints[name]):
                kind = f"mimics {joint.mimics}" if joint.mimics else f"is {joint.kind}"
                raise make_error(key, f"the joint {name} {kind}, so that no controller can command it")
        return given

    @staticmethod
    def _can_move(joint: BodyJoint) -> bool:
        return joint.kind in ("revolute", "continuous", "prismatic") and not joint.mimics

    def clean(self) -> BodyModel:
        """Make the model of the joints that controllers command; all others are fixed."""
        model = self.urdf.model
        joints = tuple(self._limit(joint) if joint.name in self._moving else self._fix(joint) for joint in model.joints)
        beyond = self._find_beyond() if self._section.gripper == "dropped" else set()
        links = tuple(
            replace(link, shapes=() if link.name in beyond else tuple(map(self._make_hull, link.shapes)))
            for link in model.links
        )
        return BodyModel(self.name, links, joints)

    def _limit(self, joint: BodyJoint) -> BodyJoint:
        given = self._section.limits.get(joint.name, LimitsConfig())
        key = f"limits.{joint.name}"
        if joint.limits is None and (given.max_velocity is None or given.max_effort is None):
            raise make_error(key, f"the joint is {joint.kind} without limits: give max_velocity and max_effort")
        lower, upper, velocity, effort = joint.limits or (-_TURN, _TURN, 0.0, 0.0)
        if joint.kind == "continuous":
            lower, upper = -_TURN, _TURN
        lower = lower if given.min_position is None else given.min_position
        upper = upper if given.max_position is None else given.max_position
        velocity, effort = given.max_velocity or velocity, given.max_effort or effort
        if not lower < upper:
            raise make_error(key, f"min_position should be below max_position, got {lower:g} and {upper:g}")
        for name, value in (("max_velocity", velocity), ("max_effort", effort)):
            if value <= 0:
                raise make_error(key, f"the URDF has no {name} above 0: give one")
        kind = "prismatic" if joint.kind == "prismatic" else "revolute"
        return replace(joint, kind=kind, limits=(lower, upper, velocity, effort))

    def _fix(self, joint: BodyJoint) -> BodyJoint:
        bare = replace(joint, kind="fixed", limits=None, damping=0.0, friction=0.0, mimics="", axis=(1.0, 0.0, 0.0))
        if joint.kind in ("fixed", "floating", "planar"):
            return bare
        return replace(bare, placement=move_joint(joint, self._find_position(joint)))

    def _find_position(self, joint: BodyJoint) -> float:
        """Find the position of a joint without a controller: as given, or by the joint that it mimics; else near 0."""
        if joint.name in self._section.fixed:
            return self._section.fixed[joint.name]
        if (followed := self.urdf.joints.get(joint.mimics)) is not None:
            # A joint that mimics one that mimics another would need a chain; no description has that.
            return joint.mimic_factor * self._find_position(replace(followed, mimics="")) + joint.mimic_offset
        lower, upper, *_ = joint.limits or (0.0, 0.0)
        return min(max(0.0, lower), upper)

    def _find_beyond(self) -> set[str]:
        """Find the links that hang on the flange."""
        flange = self._section.flange
        return {link for link in self.urdf.links if any(joint.parent == flange for joint in self._find_chain(link))}

    def _make_hull(self, shape: LinkShape) -> LinkShape:
        """Replace a mesh by its convex hull, as which it collides in every engine."""
        if shape.mesh is None:
            return shape
        corners = shape.mesh.triangles.reshape(-1, 3) * shape.size
        if (extent := float((corners.max(axis=0) - corners.min(axis=0)).max())) > _LARGEST_M:
            raise ConfigError(
                f"{shape.mesh.path}: {extent:g} m large",
                hint='a mesh in millimetres has <mesh scale="0.001 0.001 0.001"> in the URDF',
            )
        return replace(shape, mesh=Mesh(self._keep(shape.mesh.encode_hull(), ".stl")))

    def _keep_visual(self, path: Path) -> Path:
        """Keep a mesh for viewers: a large one without colours of its own more coarsely."""
        content, suffix = path.read_bytes(), path.suffix.lower()
        if suffix == ".stl" and len(content) > _LARGE_BYTES:
            content = Mesh(path).encode_coarse()
        return self._keep(content, suffix)

    def _keep(self, content: bytes, suffix: str) -> Path:
        name = hashlib.sha256(content).hexdigest()[:16] + suffix
        self.files[name] = content
        return Path(name)

    def write(self, model: BodyModel) -> str:
        """Write the URDF of a model, with the materials and visual shapes of the source."""
        robot = ElementTree.Element("robot", name=self.name)
        robot.extend(copy.deepcopy(self._source.findall("material")))
        links = {link.get("name"): link for link in self._source.findall("link")}
        package = package_of(self.name)
        names = [mesh.path.name for mesh in model.meshes]
        for element in model.to_xml():
            for mesh in element.iter("mesh"):
                mesh.set("filename", f"{PACKAGE}{package}/{names[int(mesh.get('filename', '')[:-4])]}")
            if element.tag == "link":
                for visual in copy.deepcopy(links[element.get("name")].findall("visual")):
                    for mesh in visual.iter("mesh"):
                        kept = self._keep_visual(self._find_mesh(mesh.get("filename", "")))
                        mesh.set("filename", f"{PACKAGE}{package}/{kept}")
                    element.append(visual)
            robot.append(element)
        return to_text(robot)

    def complete(self) -> dict[str, object]:
        """Make the section, in which every key has its value; notes say where each comes from."""
        section, given = self._section, self._section.model_fields_set
        self.notes |= {
            "urdf": f"from {self._path.name}",
            "prismatic": "as in the URDF",
            "flange": "given",
            "tool_pose": "given" if "tool_pose" in given else "the handle begins at the flange, along +z of it",
            "base_height_m": "given" if "base_height_m" in given else "on a table",
        }
        return {
            "name": self.name,
            "urdf": URDF,
            "srdf": SRDF,
            "flange": section.flange,
            "tool_pose": section.tool_pose.model_dump(),
            "controllers": self.controllers,
            "prismatic": [joint for joint in sorted(self._moving) if self.urdf.joints[joint].kind == "prismatic"],
            "holding": self._list_holding(),
            "base_height_m": section.base_height_m,
        }

    def _list_holding(self) -> list[str]:
        """List the links that hold the tool."""
        if self._section.holding is not None:
            self.notes["holding"] = "given"
            return self._section.holding
        self.notes["holding"] = f"the flange, {_HOLDING} links before it, and what is fixed to them"
        moving = [index for index, joint in enumerate(self.chain) if joint.name in self._moving]
        begin = moving[-_HOLDING:][0] if moving else 0
        held = {self._section.flange, *(joint.parent for joint in self.chain[begin:]), *self._find_beyond()}
        for joint in self.urdf.model.joints:
            if joint.parent in held and joint.name not in self._moving:
                held.add(joint.child)
        return sorted(held)
