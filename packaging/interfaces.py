"""Write all interfaces that we know into ``rclzenoh/interfaces/interfaces.json``, with fields, type hashes and texts.

``python packaging/interfaces.py`` reads ``rclzenoh/interfaces/definitions/<package>/{msg,srv,action}/``, and the
messages of Jazzy that rosbags has; a file takes precedence, because rosbags keeps no default values. Nodes do without
rosbags, whose import took a tenth of their start.

The generators of ROS 2 derive further structures from a service or an action: requests, events, the services and the
feedback message behind an action. They are derived here, too, because type hashes cover them (rosidl 4.6, Jazzy).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import create_field_desc
from rosbags.typesys.msg import MSGParser

FOLDER = Path(__file__).resolve().parents[1] / "src" / "rclzenoh" / "interfaces"
PATH = FOLDER / "interfaces.json"
_BASE, _NAME, _ARRAY, _SEQUENCE = Nodetype.BASE, Nodetype.NAME, Nodetype.ARRAY, Nodetype.SEQUENCE
_PLACEHOLDER = "structure_needs_at_least_one_member"
"""Field that rosidl puts into a structure without fields; it is one byte on the wire and invisible in Python."""


class Interfaces:
    """All interfaces.

    Attributes:
        store: Type store of rosbags that has them.
        defaults: Default values of fields by structure and field.
    """

    def __init__(self) -> None:
        self.store = get_typestore(Stores.EMPTY)
        self.defaults: dict[str, dict[str, Any]] = {}
        for name, (constants, fields) in get_typestore(Stores.ROS2_JAZZY).fielddefs.items():
            self._add(name, fields, constants)
        for path in sorted((FOLDER / "definitions").rglob("*.*")):
            full, parts = path.relative_to(FOLDER / "definitions").with_suffix("").as_posix(), path.read_text()
            {"msg": self._parse, "srv": self._add_service, "action": self._add_action}[path.suffix[1:]](full, parts)

    def write(self) -> str:
        """Text of the file, with a line for each structure."""
        lines = (f"{json.dumps(name)}: {self._describe(name)}" for name in sorted(self.store.fielddefs))
        return "{\n" + ",\n".join(lines) + "\n}\n"

    def _describe(self, name: str) -> str:
        constants, fields = self.store.fielddefs[name]
        defaults = self.defaults.get(name, {})
        described = {
            "constants": {constant: value for constant, _, value in constants},
            "fields": [
                _describe_field(field, description, defaults.get(field))
                for field, description in fields
                if field != _PLACEHOLDER
            ],
            "hash": self.store.hash_rihs01(name),
        }
        if "/msg/" in name:
            described["text"] = self.store.generate_msgdef(name, ros_version=2)[0].partition("=" * 80)[0]
        return json.dumps(described, separators=(",", ":"))

    def _add(self, name: str, fields: Any, constants: Any = ()) -> None:
        content = [(field, _replace_char(description)) for field, description in fields]
        self.store.fielddefs[name] = (list(constants), content or [(_PLACEHOLDER, (_BASE, ("uint8", 0)))])

    def _parse(self, name: str, text: str) -> None:
        # Each part is parsed as if it were a message of the package, because relative names mean messages of that
        # package.
        package, _, short = name.split("/")
        message = MSGParser(f"MSG: {package}/msg/{short}\n{text}").specification()[0]
        self.defaults[name] = {
            field.name: field.value
            for field in message.fields
            if field.value is not None and not isinstance(field.value, list)
        }
        self._add(
            name,
            [(field.name, create_field_desc(field.typ)) for field in message.fields],
            [(constant.name, constant.typ.value, constant.value) for constant in message.constants],
        )

    def _add_service(self, full: str, text: str) -> None:
        for part, content in zip(("Request", "Response"), text.split("---\n"), strict=True):
            self._parse(f"{full}_{part}", content)
        self._derive_service(full)

    def _derive_service(self, full: str) -> None:
        info = (_NAME, "service_msgs/msg/ServiceEventInfo")
        request, response = (_NAME, f"{full}_Request"), (_NAME, f"{full}_Response")
        self._add(
            f"{full}_Event",
            [("info", info), ("request", (_SEQUENCE, (request, 1))), ("response", (_SEQUENCE, (response, 1)))],
        )
        self._add(
            full,
            [("request_message", request), ("response_message", response), ("event_message", (_NAME, f"{full}_Event"))],
        )

    def _add_action(self, full: str, text: str) -> None:
        for part, content in zip(("Goal", "Result", "Feedback"), text.split("---\n"), strict=True):
            self._parse(f"{full}_{part}", content)
        goal_id = ("goal_id", (_NAME, "unique_identifier_msgs/msg/UUID"))
        goal, result, feedback = ((_NAME, f"{full}_{part}") for part in ("Goal", "Result", "Feedback"))
        stamp = (_NAME, "builtin_interfaces/msg/Time")
        self._add(f"{full}_SendGoal_Request", [goal_id, ("goal", goal)])
        self._add(f"{full}_SendGoal_Response", [("accepted", (_BASE, ("bool", 0))), ("stamp", stamp)])
        self._add(f"{full}_GetResult_Request", [goal_id])
        self._add(f"{full}_GetResult_Response", [("status", (_BASE, ("int8", 0))), ("result", result)])
        self._add(f"{full}_FeedbackMessage", [goal_id, ("feedback", feedback)])
        self._derive_service(f"{full}_SendGoal")
        self._derive_service(f"{full}_GetResult")
        self._add(
            full,
            [
                ("goal", goal),
                ("result", result),
                ("feedback", feedback),
                ("send_goal_service", (_NAME, f"{full}_SendGoal")),
                ("get_result_service", (_NAME, f"{full}_GetResult")),
                ("feedback_message", (_NAME, f"{full}_FeedbackMessage")),
            ],
        )


def _replace_char(description: Any) -> Any:
    """Replace ``char``, as rosidl does before it computes a type hash; rosbags does not do that."""
    if isinstance(description, tuple):
        return tuple(_replace_char(part) for part in description)
    return "uint8" if description == "char" else description


def _describe_field(name: str, description: tuple[Nodetype, Any], default: Any) -> list[Any]:
    """Values of a `rclzenoh.interfaces.catalog.Field`."""
    kind, content = description
    length: int | None = None
    bound: int | None = None
    if kind in (_ARRAY, _SEQUENCE):
        (element, content), size = content
        length = size if kind == _ARRAY else None
        bound = size or None if kind == _SEQUENCE else None
    else:
        element = kind
    if element != _NAME:
        content, capacity = content
        bound = bound if kind == _SEQUENCE else capacity or None
    return [name, content, element == _NAME, length, kind == _SEQUENCE, bound, default]


if __name__ == "__main__":
    PATH.write_text(Interfaces().write(), encoding="utf-8")
