"""Talos as example-robot-data describes it: where its files are, its limits, its half-sitting posture.

Nothing here simulates; the numbers come from `talos_reduced.urdf` and `talos.srdf` of that package.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from throwcollect.errors import ConfigError
from throwcollect.robots.talos import JOINTS

_DATA = "example-robot-data/robots/talos_data"


@dataclass(frozen=True)
class JointLimits:
    """Limits and damping of the 32 joints, each of shape ``(32,)`` in the order of `talos.JOINTS`.

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


def share_directory() -> Path:
    """Directory that ``package://example-robot-data/...`` paths are relative to.

    Raises:
        ConfigError: If example-robot-data is not installed or came without Talos.
    """
    try:
        share = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError as error:
        raise ConfigError("the robot's description is missing", hint="pip install example-robot-data") from error
    if not (share / _DATA).is_dir():
        raise ConfigError(f"{share / _DATA}: the robot's description is missing", hint="reinstall example-robot-data")
    return share


def urdf_path() -> Path:
    """Path of Talos' URDF.

    Raises:
        ConfigError: If example-robot-data is not installed or came without Talos.
    """
    return share_directory() / _DATA / "robots" / "talos_reduced.urdf"


def _parse(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()  # noqa: S314 - a file of an installed package
    except (OSError, ElementTree.ParseError) as error:
        raise ConfigError(f"{path}: cannot be read as robot description: {error}") from error


@cache
def joint_limits() -> JointLimits:
    """Limits of the 32 joints, from the URDF.

    Raises:
        ConfigError: If the URDF cannot be read or lacks a joint or its limits.
    """
    path = urdf_path()
    joints = {joint.get("name"): joint for joint in _parse(path).iter("joint") if joint.find("limit") is not None}
    rows = []
    for name in JOINTS:
        joint = joints.get(name)
        limit = joint.find("limit") if joint is not None else None
        if joint is None or limit is None:
            raise ConfigError(f"{path}: joint {name} is missing or has no limit")
        dynamics = joint.find("dynamics")
        damping = dynamics.get("damping", "0") if dynamics is not None else "0"
        try:
            numbers = [float(limit.attrib[key]) for key in ("lower", "upper", "velocity", "effort")]
            rows.append([*numbers, float(damping)])
        except (KeyError, ValueError) as error:
            raise ConfigError(f"{path}: joint {name}: limit is not readable: {error}") from error
    table = np.array(rows)
    table.flags.writeable = False
    return JointLimits(*table.T)


@cache
def half_sitting() -> Mapping[str, float]:
    """Joint angles [rad] of the SRDF's half-sitting posture for all 32 joints; those it omits are 0.

    Raises:
        ConfigError: If the SRDF cannot be read or has no such posture.
    """
    path = share_directory() / _DATA / "srdf" / "talos.srdf"
    state = _parse(path).find("group_state[@name='half_sitting']")
    if state is None:
        raise ConfigError(f"{path}: no group_state half_sitting")
    angles = {joint.get("name"): joint.get("value", "0") for joint in state.iter("joint")}
    try:
        return MappingProxyType({name: float(angles.get(name, "0")) for name in JOINTS})
    except ValueError as error:
        raise ConfigError(f"{path}: group_state half_sitting is not readable: {error}") from error
