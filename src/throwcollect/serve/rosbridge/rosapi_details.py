"""Definitions of messages and services as rosapi tells them: one entry for each message that they consist of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclzenoh.interfaces.catalog import structure
from throwcollect import ros
from throwcollect.ros.names import find_interface, full_name
from throwcollect.ros.values import array_parts

Definition = Mapping[str, object]
"""Fields of rosapi_msgs/msg/TypeDef."""


def describe_message(name: str) -> list[Definition]:
    """Tell the definition of a message.

    Args:
        name: Its name, in full or as ``pkg/Type``.

    Raises:
        ConfigError: If there is no such message.
    """
    full = full_name("msg", name)
    return _describe(full, find_interface("msg", ros.get_message, full), [])


def describe_request(name: str) -> list[Definition]:
    """Tell the definition of the request of a service.

    Args:
        name: Name of the service, in full or as ``pkg/Type``.

    Raises:
        ConfigError: If there is no such service.
    """
    full = full_name("srv", name)
    return _describe(f"{full}_Request", find_interface("srv", ros.get_service, full).Request, [])


def describe_response(name: str) -> list[Definition]:
    """Tell the definition of the response of a service.

    Args:
        name: Name of the service, in full or as ``pkg/Type``.

    Raises:
        ConfigError: If there is no such service.
    """
    full = full_name("srv", name)
    return _describe(f"{full}_Response", find_interface("srv", ros.get_service, full).Response, [])


def _describe(name: str, message_class: Any, seen: list[str]) -> list[Definition]:
    seen.append(name)
    message, kinds, lengths, examples = message_class(), [], [], []
    types = message_class.get_fields_and_field_types()
    for field, kind in types.items():
        parts = array_parts(kind)
        kinds.append(parts[0] if parts else kind)
        lengths.append(-1 if parts is None else parts[2] or 0)
        examples.append("[]" if parts else "{}" if "/" in kind else str(getattr(message, field)))
    constants = _constants(name)
    package, _, short = name.replace("/", " ").split()
    definition = {
        "type": f"{package}/{short}",
        "fieldnames": list(types),
        "fieldtypes": kinds,
        "fieldarraylen": lengths,
        "examples": examples,
        "constnames": list(constants),
        "constvalues": [str(value) for value in constants.values()],
    }
    found: list[Definition] = [definition]
    for kind in kinds:
        inner = full_name("msg", kind)
        if "/" in kind and inner not in seen:
            found += _describe(inner, ros.get_message(inner), seen)
    return found


def _constants(name: str) -> Mapping[str, object]:
    try:
        return structure(name).constants
    except ValueError:
        return {}
