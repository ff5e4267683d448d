"""Finds the robot of a configuration: one that is installed, or one that a URDF describes."""

from __future__ import annotations

from throwcollect.config.robot_config import DescribedRobotConfig, RobotConfig
from throwcollect.members import load_member
from throwcollect.robots.imported import make_robot
from throwcollect.robots.importing import import_robot
from throwcollect.robots.robot import Robot


def find_robot(of: RobotConfig | str) -> Robot:
    """Find the robot of a section, or of the name of an installed robot.

    Raises:
        ConfigError: If it cannot be loaded, or if it is described by a URDF that cannot be read or contradicts the
            section.
    """
    section = complete(of)
    if isinstance(section, DescribedRobotConfig):
        return make_robot(section)
    robot: Robot = load_member("robots", section.name)
    return robot


def complete(of: RobotConfig | str) -> RobotConfig:
    """Import the robot of a section that only names it or its URDF: all keys get their values, and paths are absolute.

    Sections that are complete, and those of robots that are no URDF alone, are returned as they are.
    """
    section = RobotConfig.model_construct(name=of) if isinstance(of, str) else of
    if not isinstance(section, DescribedRobotConfig):
        member = load_member("robots", section.name)
        if isinstance(member, Robot):
            return section
        own = {name: getattr(section, name) for name in section.model_fields_set - {"name"}}
        section = member.model_copy(update=own)
    return section if section.sha256 is not None else import_robot(section)
