"""Examines whether this machine has everything that a collection needs."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

from throwcollect import ros_installation
from throwcollect.build import build_digest
from throwcollect.collect.runtimes.runtime import Check, get_runtime
from throwcollect.config.robot_config import DescribedRobotConfig
from throwcollect.errors import ConfigError, MemberError
from throwcollect.extras import (
    ENGINE_PACKAGES,
    EXTRA_OF,
    MissingExtraError,
    explain_missing,
    has_wheel,
    install_command,
    is_installed,
)
from throwcollect.members import explain_failure, load_member, names_of
from throwcollect.robots.importing import find_urdf
from throwcollect.robots.joint_model import joint_model
from throwcollect.robots.talos import TALOS
from throwcollect.ros.middleware import VARIABLE, uses_rclpy
from throwcollect.state_directory import state_directory
from throwcollect.wording import format_count, join_names

_GIB = 1024**3
_LEAST_DISK_GIB = 1.0
_DIGITS = 10


def _check_python() -> Check:
    found = ".".join(map(str, sys.version_info[:3]))
    if not has_wheel("pybullet"):
        return Check("python", "note", f"{found}; pybullet has wheels for 3.10 and 3.11, MuJoCo (sim.engine) for this")
    return Check("python", "ok", found)


def _check_cores() -> Check:
    cores = len(os.sched_getaffinity(0))
    return Check("cores", "ok", f"{cores}; up to {format_count(cores, 'simulation')} side by side (`-n {cores}`)")


def _check_engine(name: str) -> Check:
    """Check a physics engine; a missing one is a problem only if no other one is installed.

    Of an installed one, the beginning of its build digest is shown, which two machines compare before one joins a run.
    """
    package = ENGINE_PACKAGES[name]
    if is_installed(package.module):
        found = f"{version(package.distribution)}, build {build_digest(name)[:_DIGITS]}"
        try:
            steps = load_member("engines", name).describe_steps()
        except (ConfigError, ImportError) as error:
            return Check(package.module, "problem", f"{found}; {error}")
        return Check(package.module, "ok", found + (f", steps {steps}" if steps else ""))
    others = any(is_installed(each.module) for each in ENGINE_PACKAGES.values())
    hint = f"not installed, for sim.engine: {name}; try: {MissingExtraError(package.module).hint}"
    return Check(package.module, "note" if others else "problem", hint)


def _check_robot(name: str) -> Check:
    """Check the description of a robot; only Talos is required, as collections with it run without other robots."""
    is_own = name == TALOS.name
    check = "robot" if is_own else f"robot {name}"
    try:
        with explain_failure("robots", name, "describe itself"):
            robot = load_member("robots", name)
            if isinstance(robot, DescribedRobotConfig):
                # Importing all of them would take seconds.
                return Check(check, "ok", f"{name}, {find_urdf(robot.urdf)}")
            joint_model(robot)
            package = f" of example-robot-data {version('example-robot-data')}" if is_own else ""
            return Check(check, "ok", f"{robot.title}{package}, {robot.urdf_path}")
    except (ConfigError, MemberError, MissingExtraError) as error:
        return Check(check, "problem" if is_own else "note", error.one_line)


def _check_extras() -> Check:
    """List the extras that are installed, and those of which at least one package is missing."""
    missing = sorted({extra for package, extra in EXTRA_OF.items() if has_wheel(package) and not is_installed(package)})
    complete = ", ".join(sorted(set(EXTRA_OF.values()) - set(missing)))
    if not missing:
        return Check("extras", "ok", complete)
    without = f"without {join_names(missing)} (try: {install_command(','.join(missing))})"
    return Check("extras", "note", f"{complete}, {without}" if complete else without)


def _check_runtime(name: str) -> Check | None:
    try:
        with explain_missing():
            return get_runtime(name).check()
    except MissingExtraError as error:
        return Check(name, "note", f"{error.package} is not installed; try: {error.hint}")
    except ConfigError as error:
        return Check(name, "note", error.one_line)


def _check_rclpy() -> Check:
    lacking = ros_installation.missing()
    if "rclpy" in lacking:
        return Check("rclpy", "note", f"not installed; to have it: {ros_installation.HOW_TO_INSTALL}")
    rmws = join_names(ros_installation.rmws()) or "no RMW"
    found = f"{ros_installation.rclpy_version() or 'of unknown version'} with {rmws}"
    if lacking:
        return Check("rclpy", "note", f"{found}, without {join_names(lacking)}; try: {ros_installation.HOW_TO_INSTALL}")
    return Check("rclpy", "ok", f"{found} and all interfaces")


def _check_embedded() -> Check:
    if not is_installed("zenoh"):
        return Check("embedded", "problem", f"Zenoh is not installed; try: {MissingExtraError('zenoh').hint}")
    found = f"Zenoh {version('eclipse-zenoh')}"
    try:
        chosen = "rclpy" if uses_rclpy() else "the embedded backend"
    except ConfigError as error:
        return Check("embedded", "problem", f"{found}; {error.one_line}")
    value = os.environ.get(VARIABLE)
    return Check("embedded", "ok", f"{found}; nodes run on {chosen}, as {VARIABLE} is {value or 'not set'}")


def _check_disk(directory: Path) -> Iterator[Check]:
    try:
        yield Check("state", "ok", f"runs are remembered in {state_directory()}")
    except ConfigError as error:
        yield Check("state", "problem", error.one_line)
    free = shutil.disk_usage(directory).free / _GIB
    yield Check("disk", "ok" if free >= _LEAST_DISK_GIB else "problem", f"{free:.1f} GiB free in {directory}")


def examine(directory: Path) -> list[Check]:
    """Check everything that a collection into a directory needs; the findings come in a fixed order."""
    return [
        _check_python(),
        _check_extras(),
        _check_cores(),
        *map(_check_engine, ENGINE_PACKAGES),
        *map(_check_robot, names_of("robots")),
        _check_rclpy(),
        _check_embedded(),
        *filter(None, map(_check_runtime, names_of("runtimes"))),
        *_check_disk(directory),
    ]
