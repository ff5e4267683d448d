"""Type descriptions and sources of interfaces (REP 2016), as nodes tell them to each other.

A type hash is that of the description in JSON without default values, so whoever receives one can check it.
"""

from __future__ import annotations

from collections.abc import Iterator

from throwcollect.interfaces.catalog import DEFINITIONS, PLACEHOLDER, Field, Structure, message_definition, structure
from throwcollect.interfaces.lookup import get_message
from throwcollect.interfaces.message import Message

_TypeDescription = get_message("type_description_interfaces/msg/TypeDescription")
_Individual = get_message("type_description_interfaces/msg/IndividualTypeDescription")
_Field = get_message("type_description_interfaces/msg/Field")
_FieldType = get_message("type_description_interfaces/msg/FieldType")
_TypeSource = get_message("type_description_interfaces/msg/TypeSource")

_KINDS = {"float32": "FLOAT", "float64": "DOUBLE", "bool": "BOOLEAN"}
_ARRAY, _BOUNDED_SEQUENCE, _UNBOUNDED_SEQUENCE = "_ARRAY", "_BOUNDED_SEQUENCE", "_UNBOUNDED_SEQUENCE"
_PLACEHOLDER = Field(PLACEHOLDER, "uint8", nested=False)
_IMPLICIT = "implicit"
"""Encoding of what has no definition of its own, as it is derived from a service or an action."""
_RULE = "=" * 80 + "\n"


def type_description(name: str) -> Message:
    """Description of an interface and of everything that it consists of.

    Args:
        name: Full name, such as ``std_srvs/srv/Trigger``.

    Returns:
        type_description_interfaces/msg/TypeDescription.

    Raises:
        ValueError: If no such interface is known.
    """
    own, *others = _family(name)
    return _TypeDescription(
        type_description=_individual(own), referenced_type_descriptions=[_individual(other) for other in others]
    )


def type_sources(name: str) -> list[Message]:
    """Definitions that an interface and everything that it consists of are made from, without upstream's comments.

    Args:
        name: Full name, such as ``std_srvs/srv/Trigger``.

    Returns:
        type_description_interfaces/msg/TypeSource each, that of the interface first.

    Raises:
        ValueError: If no such interface is known.
    """
    return [_source(each.name) for each in _family(name)]


def _family(name: str) -> Iterator[Structure]:
    """A structure and all that it consists of: itself first, the others by name."""
    found = {name: structure(name)}
    new = [name]
    while new:
        for field in found[new.pop()].fields:
            if field.nested and field.type not in found:
                found[field.type] = structure(field.type)
                new.append(field.type)
    yield found.pop(name)
    yield from (found[other] for other in sorted(found))


def _individual(described: Structure) -> Message:
    fields = described.fields or (_PLACEHOLDER,)
    return _Individual(
        type_name=described.name,
        fields=[_Field(name=field.name, type=_type(field), default_value=_default(field)) for field in fields],
    )


def _type(field: Field) -> Message:
    kind = "NESTED_TYPE" if field.nested else _KINDS.get(field.type, field.type.upper())
    message = _FieldType(nested_type_name=field.type if field.nested else "")
    if field.length is not None:
        kind, message.capacity = kind + _ARRAY, field.length
    elif field.sequence and field.bound is not None:
        kind, message.capacity = kind + _BOUNDED_SEQUENCE, field.bound
    elif field.sequence:
        kind += _UNBOUNDED_SEQUENCE
    elif field.bound is not None:
        kind, message.string_capacity = f"BOUNDED_{kind}", field.bound
    message.type_id = getattr(_FieldType, f"FIELD_TYPE_{kind}")
    return message


def _default(field: Field) -> str:
    if field.default is None:
        return ""
    return str(float(field.default) if field.type.startswith("float") else field.default)


def _source(name: str) -> Message:
    package, kind, short = name.split("/")
    path = DEFINITIONS / package / kind / f"{short}.{kind}"
    if path.is_file():
        return _TypeSource(type_name=name, encoding=kind, raw_file_contents=path.read_text())
    if kind != "msg":
        return _TypeSource(type_name=name, encoding=_IMPLICIT)
    text = message_definition(name).partition(_RULE)[0].strip("\n")
    return _TypeSource(type_name=name, encoding=kind, raw_file_contents=f"{text}\n")
