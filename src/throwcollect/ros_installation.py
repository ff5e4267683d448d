"""Finds out which parts of genuine ROS 2 are installed for this Python, without importing any of them.

This module is not a part of `ros`, because importing `ros` already needs the answer.
"""

from __future__ import annotations

import os
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from throwcollect.extras import is_installed

PACKAGES = (
    "action_msgs",
    "builtin_interfaces",
    "control_msgs",
    "controller_manager_msgs",
    "geometry_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "simulation_interfaces",
    "std_msgs",
    "tf2_msgs",
    "trajectory_msgs",
    "unique_identifier_msgs",
)
"""Packages whose interfaces nodes use."""

HOW_TO_INSTALL = (
    "in a clone of throwcollect, by CPython 3.11 on x86-64: pip install ./packaging/ros_interfaces '.[collect,ros]'; "
    "or source the setup script of a ROS 2 Jazzy (/opt/ros/jazzy/setup.sh)"
)
"""How to install rclpy and all interfaces."""


def missing() -> list[str]:
    """List the parts of genuine ROS 2 that nodes need and Python lacks: rclpy, or else packages of interfaces."""
    # A directory of that name in the working directory, without a module in it, is no package of ROS.
    return [package for package in PACKAGES if not is_installed(package)] if is_installed("rclpy") else ["rclpy"]


def rmws() -> list[str]:
    """List the names of the RMW implementations that are installed, in alphabetical order."""
    # Setup scripts of ROS set AMENT_PREFIX_PATH; wheels install below the prefix of Python, and set no variable.
    prefixes = filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix])
    index = Path("share", "ament_index", "resource_index", "rmw_typesupport")
    names = {path.name for prefix in prefixes for path in (Path(prefix) / index).glob("rmw_*")}
    # The package `rmw_implementation` only loads one of the others.
    return sorted(names - {"rmw_implementation"})


def rclpy_version() -> str | None:
    """Find the version of rclpy, by its wheel or else by its package; None if there is neither."""
    for distribution in ("ros-rclpy", "rclpy"):
        try:
            return version(distribution)
        except PackageNotFoundError:
            continue
    return None
