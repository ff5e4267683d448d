"""Describes messages and services in the form of rosapi: one entry for each message inside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from rclzenoh.interfaces.catalog import structure
from throwcollect import ros
from throwcollect.ros.graph_names import find_interface, full_name
from throwcollect.ros.message_values import array_parts

Definition = Mapping[str, object]
"""Fields of rosapi_msgs/msg/TypeDef."""


def describe_message(name: str) -> list[Definition]:
    """Describe a message, named in full or as ``pkg/Type``."""
    return _describe(full_name("msg", name), find_interface("msg", name), [])


def describe_service(name: str, part: Literal["Request", "Response"]) -> list[Definition]:
    """Describe the request or the response of a service, named in full or as ``pkg/Type``."""
    service = find_interface("srv", name)
    return _describe(f"{full_name('srv', name)}_{part}", getattr(service, part), [])


def _describe(name: str, message_class: Any, seen: list[str]) -> list[Definition]:
    seen.append(name)
    message, kinds, lengths, examples = message_class(), [], [], []
    types = message_class.get_fields_and_field_types()
    for field, kind in types.items():
        parts = array_parts(kind)
        kinds.append(parts[0] if parts else kind)
        # In rosapi, -1 stands for no array, and 0 for an array of any length.
        lengths.append(-1 if parts is None else parts[2] or 0)
        examples.append("[]" if parts else "{}" if "/" in kind else str(getattr(message, field)))
    constants = _find_constants(name)
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


def _find_constants(name: str) -> Mapping[str, object]:
    try:
        return structure(name).constants
    except ValueError:
        return {}
