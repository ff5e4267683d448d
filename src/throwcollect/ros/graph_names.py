"""Converts names that people and programs outside of ROS give, and makes names for our own nodes that only look on."""

from __future__ import annotations

import itertools
import os
from typing import Any, Literal

from rclzenoh.exceptions import NameValidationException
from rclzenoh.names import resolve
from throwcollect import ros
from throwcollect.errors import ConfigError

Kind = Literal["msg", "srv", "action"]
"""Kind of an interface, as it stands in full names."""

_DEPTH = 100

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
    find: Any = {"msg": ros.get_message, "srv": ros.get_service, "action": ros.get_action}[kind]
    try:
        return find(full_name(kind, name))
    except ValueError as error:
        raise ConfigError(f"{name}: {error}") from error


def find_offered_qos(node: ros.Node, topic: str, unknown: ros.ReliabilityPolicy) -> ros.QoSProfile:
    """The strictest profile that all publishers of a topic, given by its absolute name, offer.

    While there is no publisher, reliability is ``unknown``: best effort hears every publisher, reliable suits most.
    """
    # ROS 2 connects a subscription only to publishers that offer what it asks for, so the weakest publisher decides.
    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    profile = ros.QoSProfile(depth=_DEPTH, reliability=unknown)
    if offered:
        is_reliable = all(qos.reliability == ros.ReliabilityPolicy.RELIABLE for qos in offered)
        profile.reliability = ros.ReliabilityPolicy.RELIABLE if is_reliable else ros.ReliabilityPolicy.BEST_EFFORT
    if offered and all(qos.durability == ros.DurabilityPolicy.TRANSIENT_LOCAL for qos in offered):
        profile.durability = ros.DurabilityPolicy.TRANSIENT_LOCAL
    return profile
