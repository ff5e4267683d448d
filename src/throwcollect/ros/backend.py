"""Which backend nodes run on: the environment variable ``THROWCOLLECT_ROS`` is ``auto``, ``rclpy`` or ``embedded``."""

from __future__ import annotations

import os
from functools import cache
from importlib.util import find_spec

from throwcollect.errors import ConfigError

VARIABLE = "THROWCOLLECT_ROS"
"""Name of the environment variable."""


@cache
def uses_rclpy() -> bool:
    """Whether nodes run on genuine rclpy: if it is asked for, or by default if it can be imported.

    Raises:
        ConfigError: If the variable has another value, or asks for an rclpy that is not there.
    """
    wanted = os.environ.get(VARIABLE) or "auto"
    if wanted not in ("auto", "rclpy", "embedded"):
        raise ConfigError(f"{VARIABLE}: got {wanted!r}", expected="auto, rclpy or embedded")
    if wanted == "embedded":
        return False
    found = find_spec("rclpy") is not None
    if wanted == "rclpy" and not found:
        raise ConfigError(
            f"{VARIABLE} is rclpy, but Python does not find it",
            hint="source the setup script of ROS 2 Jazzy (/opt/ros/jazzy/setup.sh), or set it to embedded",
        )
    return found
