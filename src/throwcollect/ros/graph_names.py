"""Converts names that people and programs outside of ROS give, and makes names for our own nodes that only look on."""

from __future__ import annotations

import itertools
import os
from typing import Any

from rclzenoh.exceptions import NameValidationException
from rclzenoh.names import resolve
from throwcollect.errors import ConfigError
from throwcollect.ros.backend_names import Kind, find_class

_numbers = itertools.count()


def absolute_name(name: str) -> str:
    """Absolute name of a node, topic, service or action that a user names with or without its leading slash."""
    try:
        return resolve(name, "/", "")
    except NameValidationException as error:
        expected = "letters, digits and underscores between single slashes"
        raise ConfigError(f"{name!r} is no name in ROS", expected=expected) from error


def is_hidden(name: str) -> bool:
    """Whether ROS hides a name, because a part of it begins with an underscore."""
    return any(part.startswith("_") for part in name.split("/"))


def make_own_name() -> str:
    """Hidden name of a node by which a process of ours asks or looks on; no other node of this machine has it."""
    return f"_throwcollect_{os.getpid()}_{next(_numbers)}"


def full_name(kind: Kind, name: str) -> str:
    """Full name of a type that may be named without its kind, as ``std_msgs/String`` for ``std_msgs/msg/String``."""
    return name.replace("/", f"/{kind}/") if name.count("/") == 1 else name


def find_interface(kind: Kind, name: str) -> Any:
    """Class of a message, service or action that a user names in full, or without its ``kind``."""
    try:
        return find_class(kind, full_name(kind, name))
    except ValueError as error:
        raise ConfigError(f"{name}: {error}") from error
