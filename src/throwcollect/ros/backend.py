"""Which backend nodes run on: the environment variable ``THROWCOLLECT_ROS`` is ``auto``, ``rclpy`` or ``embedded``."""

from __future__ import annotations

import os
from functools import cache

from throwcollect.errors import ConfigError
from throwcollect.ros_installation import how_to_install, missing, rmws
from throwcollect.wording import listed

VARIABLE = "THROWCOLLECT_ROS"
"""Name of the environment variable."""
RMW_VARIABLE = "RMW_IMPLEMENTATION"
"""Name of the environment variable by which rclpy chooses what it talks through."""
EMBEDDED_RMW = "rmw_zenoh_cpp"
"""The RMW whose wire protocol the embedded backend speaks."""


@cache
def uses_rclpy() -> bool:
    """Whether nodes run on genuine rclpy: if it is asked for, or by default if Python finds it and all interfaces.

    By default they do not where the environment asks for rmw_zenoh_cpp and ROS does not have it: the embedded backend
    speaks as that does.

    Raises:
        ConfigError: If the variable has another value, or asks for an rclpy that is not there or lacks interfaces, or
            the RMW that the environment asks for is not installed.
    """
    wanted = os.environ.get(VARIABLE) or "auto"
    if wanted not in ("auto", "rclpy", "embedded"):
        raise ConfigError(f"{VARIABLE}: got {wanted!r}", expected="auto, rclpy or embedded")
    if wanted == "embedded":
        return False
    if lacking := missing():
        if wanted == "auto":
            return False
        raise ConfigError(
            f"{VARIABLE} is rclpy, but Python does not find {listed(lacking)}",
            hint=f"{how_to_install()}; or set it to embedded",
        )
    rmw, installed = os.environ.get(RMW_VARIABLE), rmws()
    if not rmw or rmw in installed:
        return True
    if wanted == "auto" and rmw == EMBEDDED_RMW:
        return False
    raise ConfigError(
        f"{RMW_VARIABLE} is {rmw}, which is not installed",
        expected=listed(installed, "or") or "an installed RMW",
        hint=f"unset {RMW_VARIABLE}, or set {VARIABLE}=embedded",
    )
