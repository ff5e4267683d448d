"""All known interfaces: the messages of Jazzy in ``jazzy.json``, completed by the files in ``definitions``.

``packaging/jazzy_messages.py`` takes those messages from rosbags. Services and actions, messages that rosbags lacks,
and messages whose default values it does not keep are read from ``definitions/<package>/{msg,srv,action}/`` when they
are first needed; a file takes precedence over ``jazzy.json``.

The generators of ROS 2 derive further structures from a service or an action: requests, events, the services and the
feedback message behind an action. They are derived here, too, because type hashes cover them (rosidl 4.6, Jazzy).
"""

from __future__ import annotations

import difflib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import create_field_desc
from rosbags.typesys.msg import MSGParser

DEFINITIONS = Path(__file__).parent / "definitions"
"""Our own definition files."""

PLACEHOLDER = "structure_needs_at_least_one_member"
"""Field that rosidl puts into a structure without fields; it is one byte on the wire and invisible in Python."""

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
        fields: Fields in order; empty when the wire has only the placeholder.
    """

    constants: dict[str, Default]
    fields: tuple[Field, ...]


_BASE, _NAME, _ARRAY, _SEQUENCE = Nodetype.BASE, Nodetype.NAME, Nodetype.ARRAY, Nodetype.SEQUENCE
_STORE = get_typestore(Stores.EMPTY)
_FIELDDEFS: dict[str, Any] = _STORE.fielddefs
_JAZZY = json.loads((Path(__file__).parent / "jazzy.json").read_text(encoding="utf-8"))
_DEFAULTS: dict[str, dict[str, Default]] = {}
_READ: set[Path] = set()
_COMPLETE: set[str] = set()


def structure(name: str) -> Structure:
    """Constants and fields of a structure: ``sensor_msgs/msg/JointState`` or ``std_srvs/srv/Trigger_Response``."""
    _require(name)
    constants, fields = _FIELDDEFS[name]
    defaults = _DEFAULTS.get(name, {})
    return Structure(
        {constant: value for constant, _, value in constants},
        tuple(
            _make_field(field, description, defaults.get(field))
            for field, description in fields
            if field != PLACEHOLDER
        ),
    )


@cache
def type_hash(name: str) -> str:
    """Type hash (REP 2016) of a message, service, action or a part of one: ``RIHS01_`` and 64 hexadecimal digits."""
    _require(name)
    return _STORE.hash_rihs01(name)


@cache
def message_definition(name: str) -> str:
    """Definition text of a message and all messages it consists of, as rosbag2 stores it (``ros2msg``).

    The definition of the message comes first, then those of its dependencies, each after a line of 80 ``=`` and
    ``MSG: <name>``.
    """
    _require(name)
    return _STORE.generate_msgdef(name, ros_version=2)[0]


def _make_field(name: str, description: tuple[Nodetype, Any], default: Default | None) -> Field:
    kind, content = description
    length: int | None = None
    sequence = kind == _SEQUENCE
    bound: int | None = None
    if kind in (_ARRAY, _SEQUENCE):
        (kind, content), size = content
        length = None if sequence else size
        bound = size or None if sequence else None
    if kind == _NAME:
        return Field(name, content, True, length, sequence, bound, default)
    primitive, capacity = content
    return Field(name, primitive, False, length, sequence, bound if sequence else capacity or None, default)


def _require(name: str) -> None:
    """Read the definitions of ``name`` and of everything it refers to, unless they have been read before."""
    if name in _COMPLETE:
        return
    package, _, rest = name.partition("/")
    kind, _, type_name = rest.partition("/")
    # In ROS, names of interfaces have no underscore, and those of their parts have one, such as Trigger_Request.
    whole = type_name.split("_")[0]
    path = DEFINITIONS / package / kind / f"{whole}.{kind}"
    is_plausible = kind in ("msg", "srv", "action") and type_name.isidentifier()
    if is_plausible and path not in _READ and path.is_file():
        _READ.add(path)
        parts = path.read_text().split("---\n")
        {"msg": _add_message, "srv": _add_service, "action": _add_action}[kind](f"{package}/{kind}/{whole}", parts)
    if name not in _FIELDDEFS and name in _JAZZY:
        constants, fields = _JAZZY[name]
        _add(name, [(field, _read_description(description)) for field, description in fields], constants)
    if name not in _FIELDDEFS:
        raise ValueError(f"unknown interface {name!r}{_suggest_similar(name)}")
    _COMPLETE.add(name)
    for _, (field_kind, content) in _FIELDDEFS[name][1]:
        element = content[0] if field_kind in (_ARRAY, _SEQUENCE) else (field_kind, content)
        if element[0] == _NAME:
            _require(element[1])


def _suggest_similar(name: str) -> str:
    files = (path.relative_to(DEFINITIONS).with_suffix("").as_posix() for path in DEFINITIONS.rglob("*.*"))
    near = difflib.get_close_matches(name, {*files, *_FIELDDEFS, *_JAZZY}, n=3)
    return f"; did you mean {' or '.join(map(repr, near))}?" if near else ""


def _read_description(description: list[Any]) -> tuple[Nodetype, Any]:
    """Convert the description of a field from JSON to the form that rosbags has."""
    kind, content = Nodetype(description[0]), description[1]
    if kind in (_ARRAY, _SEQUENCE):
        element, size = content
        return kind, (_read_description(element), size)
    return kind, tuple(content) if kind == _BASE else content


def _replace_char(description: Any) -> Any:
    """Replace ``char``, as rosidl does before it computes a type hash; rosbags does not do that."""
    if isinstance(description, tuple):
        return tuple(_replace_char(part) for part in description)
    return "uint8" if description == "char" else description


def _parse(name: str, text: str) -> None:
    # Each part is parsed as if it were a message of the package, because relative names mean messages of that package.
    package, _, short = name.split("/")
    message = MSGParser(f"MSG: {package}/msg/{short}\n{text}").specification()[0]
    _DEFAULTS[name] = {
        field.name: field.value
        for field in message.fields
        if field.value is not None and not isinstance(field.value, list)
    }
    _add(
        name,
        [(field.name, create_field_desc(field.typ)) for field in message.fields],
        [(constant.name, constant.typ.value, constant.value) for constant in message.constants],
    )


def _add(name: str, fields: list[tuple[str, object]], constants: list[tuple[str, str, Default]] | None = None) -> None:
    content = [(field, _replace_char(description)) for field, description in fields]
    _FIELDDEFS[name] = (constants or [], content or [(PLACEHOLDER, (_BASE, ("uint8", 0)))])


def _add_message(full: str, parts: list[str]) -> None:
    _parse(full, parts[0])


def _add_service(full: str, parts: list[str]) -> None:
    _parse(f"{full}_Request", parts[0])
    _parse(f"{full}_Response", parts[1])
    _derive_service(full)


def _derive_service(full: str) -> None:
    info = (_NAME, "service_msgs/msg/ServiceEventInfo")
    request, response = (_NAME, f"{full}_Request"), (_NAME, f"{full}_Response")
    _add(
        f"{full}_Event",
        [("info", info), ("request", (_SEQUENCE, (request, 1))), ("response", (_SEQUENCE, (response, 1)))],
    )
    _add(
        full,
        [("request_message", request), ("response_message", response), ("event_message", (_NAME, f"{full}_Event"))],
    )


def _add_action(full: str, parts: list[str]) -> None:
    for part, text in zip(("Goal", "Result", "Feedback"), parts, strict=True):
        _parse(f"{full}_{part}", text)
    goal_id = ("goal_id", (_NAME, "unique_identifier_msgs/msg/UUID"))
    goal, result, feedback = ((_NAME, f"{full}_{part}") for part in ("Goal", "Result", "Feedback"))
    stamp = (_NAME, "builtin_interfaces/msg/Time")
    _add(f"{full}_SendGoal_Request", [goal_id, ("goal", goal)])
    _add(f"{full}_SendGoal_Response", [("accepted", (_BASE, ("bool", 0))), ("stamp", stamp)])
    _add(f"{full}_GetResult_Request", [goal_id])
    _add(f"{full}_GetResult_Response", [("status", (_BASE, ("int8", 0))), ("result", result)])
    _add(f"{full}_FeedbackMessage", [goal_id, ("feedback", feedback)])
    _derive_service(f"{full}_SendGoal")
    _derive_service(f"{full}_GetResult")
    _add(
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
