"""Finds out which parts of genuine ROS 2 are installed for this Python, without importing any of them.

This module is not a part of `ros`, because importing `ros` already needs the answer.
"""

from __future__ import annotations

import os
import platform
import re
import shlex
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import rclzenoh

# The path is not taken from `rclzenoh.interfaces`, because importing that would take health checks too long.
DEFINITIONS = Path(rclzenoh.__file__).parent / "interfaces" / "definitions"
"""Definitions of interfaces, by package and kind."""
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

_BY_PIP = "CPython 3.11 on Linux, x86-64, with glibc"
_SETUP = "source the setup script of a ROS 2 Jazzy that has it (/opt/ros/jazzy/setup.sh)"
_CLONE = Path(__file__).parents[2]
_INTERFACES = "packaging/ros_interfaces"


def missing() -> list[str]:
    """List the parts of genuine ROS 2 that nodes need and Python lacks: rclpy, or else packages and interfaces."""
    if _find_directory("rclpy") is None:
        return ["rclpy"]
    lacking = []
    for package in PACKAGES:
        directory = _find_directory(package)
        if directory is None:
            lacking.append(package)
            continue
        for path in sorted((DEFINITIONS / package).glob("*/*")):
            kind = path.parent.name
            if not (directory / kind / f"_{module_name(path.stem)}.py").is_file():
                lacking.append(f"{package}/{kind}/{path.stem}")
    return lacking


def rmws(python: str = sys.prefix) -> list[str]:
    """List the names of the RMW implementations that are installed, in alphabetical order; `python` is its prefix."""
    # Setup scripts of ROS set AMENT_PREFIX_PATH; wheels install below the prefix of Python, and set no variable.
    prefixes = filter(None, [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), python])
    index = Path("share", "ament_index", "resource_index", "rmw_typesupport")
    names = {path.name for prefix in prefixes for path in (Path(prefix) / index).glob("rmw_*")}
    # The package `rmw_implementation` only loads one of the others.
    return sorted(names - {"rmw_implementation"})


def shell_rmws() -> list[str]:
    """List the RMW implementations of the ROS 2 that this process' shell finds; none if it finds no ROS 2."""
    # Its Python may be another than this one, and a shim of another place, so it is asked.
    ask = ["python3", "-c", "import sys; print(sys.prefix)"]
    try:
        said = subprocess.run(ask, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return rmws("")
    return rmws(said.stdout.strip())


def rclpy_version() -> str | None:
    """Find the version of rclpy, by its wheel or else by its package; None if there is neither."""
    for distribution in ("ros-rclpy", "rclpy"):
        try:
            return version(distribution)
        except PackageNotFoundError:
            continue
    return None


def how_to_install() -> str:
    """Say how to install rclpy and all interfaces: a command if there are wheels for this Python."""
    if not _has_wheels():
        this = f"{platform.python_implementation()} {platform.python_version()} on {platform.system()}"
        return f"{_SETUP}: by pip it is for {_BY_PIP} alone, and this is {this}, {platform.machine()}"
    if (_CLONE / _INTERFACES).is_dir():
        command = shlex.join(["pip", "install", str(_CLONE / _INTERFACES), "-e", f"{_CLONE}[collect,ros]"])
        return f"{command}, or {_SETUP}"
    return f"in a clone of throwcollect: pip install ./{_INTERFACES} '.[collect,ros]', or {_SETUP}"


def module_name(interface: str) -> str:
    """Name the module of an interface, without its leading underscore: ``SpawnEntity`` is in ``spawn_entity``."""
    # These are the two substitutions of rosidl_pycommon, by which ROS' own generators name the modules.
    words = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", interface)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", words).lower()


def _has_wheels() -> bool:
    python = (sys.implementation.name, *sys.version_info[:2])
    system = (platform.system(), platform.machine(), platform.libc_ver()[0])
    return python == ("cpython", 3, 11) and system == ("Linux", "x86_64", "glibc")


def _find_directory(package: str) -> Path | None:
    spec = find_spec(package)
    # A directory of that name in the working directory, without a module in it, is no package of ROS.
    return Path(spec.origin).parent if spec is not None and spec.origin else None
