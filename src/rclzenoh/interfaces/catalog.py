"""All known interfaces, as ``packaging/interfaces.py`` has written them into ``interfaces.json``."""

from __future__ import annotations

import difflib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Default = bool | int | float | str


@dataclass(frozen=True)
class Field:
    """One field of a structure.

    Attributes:
        name: Name of the field.
        type: Primitive type (``float64``, ``string``…) or full name of the nested structure.
        nested: Whether ``type`` names a structure.
        length: Length of a fixed array; None otherwise.
        sequence: Whether the field is a sequence.
        bound: Largest length of a bounded sequence or string, or of the strings of a fixed array; None when unbounded.
            The bound of strings in a sequence is not known here.
        default: Value of a field that is not set; None for zero, empty, or the nested structure's own defaults.
    """

    name: str
    type: str
    nested: bool
    length: int | None = None
    sequence: bool = False
    bound: int | None = None
    default: Default | None = None


@dataclass(frozen=True)
class Structure:
    """A message, or a part of a service or action.

    Attributes:
        constants: Values by name.
        fields: Fields in order; empty when the wire has only the byte of a placeholder.
    """

    constants: dict[str, Default]
    fields: tuple[Field, ...]


INTERFACES: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_name("interfaces.json").read_text("utf-8"))
"""Constants, fields and type hash of each structure by its name; messages have their own text, too."""


def structure(name: str) -> Structure:
    """Constants and fields of a structure: ``sensor_msgs/msg/JointState`` or ``std_srvs/srv/Trigger_Response``."""
    found = _find(name)
    return Structure(found["constants"], tuple(Field(*values) for values in found["fields"]))


def type_hash(name: str) -> str:
    """Type hash (REP 2016) of a message, service, action or a part of one: ``RIHS01_`` and 64 hexadecimal digits."""
    found: str = _find(name)["hash"]
    return found


def message_definition(name: str) -> str:
    """Definition text of a message and all messages it consists of, as rosbag2 stores it (``ros2msg``).

    The definition of the message comes first, then those of its dependencies, each after a line of 80 ``=`` and
    ``MSG: <name>``. Parts of services and actions have no text.
    """
    texts: dict[str, str] = {}

    def add(part: str, beginning: str) -> None:
        texts[part] = beginning + _find(part).get("text", "")
        for field in structure(part).fields:
            if field.nested and field.type not in texts:
                add(field.type, f"{'=' * 80}\nMSG: {field.type.replace('/msg/', '/')}\n")

    add(name, "")
    return "".join(texts.values())


def _find(name: str) -> dict[str, Any]:
    if name not in INTERFACES:
        near = difflib.get_close_matches(name, INTERFACES, n=3)
        hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
        raise ValueError(f"unknown interface {name!r}{hint}")
    return INTERFACES[name]
