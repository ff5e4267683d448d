"""Messages to YAML and back, in the form of the `ros2` command."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from throwcollect.errors import ConfigError
from throwcollect.ros import get_message

SHORT = 128
"""Longer texts and arrays are cut off unless wanted in full."""

_ARRAY = re.compile(r"(?:sequence<(?P<element>.+?)(?:, (?P<most>\d+))?>|(?P<item>.+)\[(?P<length>\d+)\])")
_INTEGERS = {f"{sign}int{bits}": bits for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"octet": 8}
_FLOATS = ("float", "double")


def parse(text: str, what: str) -> Any:
    """Value that YAML stands for.

    Args:
        text: The YAML.
        what: What it is, for the error.

    Raises:
        ConfigError: If it is no YAML.
    """
    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, ValueError) as error:
        raise ConfigError(f"{what}: not YAML: {str(error).splitlines()[0]}, got {text!r:.80}") from error


def fill(message: Any, values: object, where: str = "") -> None:
    """Set fields of a message.

    Args:
        message: The message.
        values: Mapping of field names to values; nested messages are mappings, too.
        where: Path of the message in the whole one, with a dot at its end.

    Raises:
        ConfigError: If there is no such field, or it cannot take the value.
    """
    types = message.get_fields_and_field_types()
    if not isinstance(values, Mapping):
        raise ConfigError(
            f"{where.rstrip('.') or 'values'}: should be fields with values, got {values!r:.80}",
            expected="{" + ", ".join(f"{name}: {kind}" for name, kind in types.items()) + "}",
        )
    for name, value in values.items():
        path = f"{where}{name}"
        if name not in types:
            raise ConfigError(f"{path}: no such field", expected=f"one of {', '.join(types)}" if types else "no field")
        current = getattr(message, name)
        if _is_message(types[name]):
            fill(current, value, f"{path}.")
            continue
        try:
            setattr(message, name, _convert(types[name], value, path))
        except (TypeError, ValueError, AssertionError) as error:
            raise ConfigError(f"{path}: should be {types[name]}, got {value!r:.80}") from error


def _convert(kind: str, value: object, path: str) -> Any:
    if found := _ARRAY.fullmatch(kind):
        if not isinstance(value, list):
            raise TypeError
        element = found["element"] or found["item"]
        most, length = found["most"], found["length"]
        if (most and len(value) > int(most)) or (length and len(value) != int(length)):
            raise ValueError
        return [_convert(element, each, f"{path}[{index}]") for index, each in enumerate(value)]
    if _is_message(kind):
        package, _, short = kind.partition("/")
        message = get_message(f"{package}/msg/{short}")()
        fill(message, value, f"{path}.")
        return message
    if kind in _INTEGERS:
        return _integer(kind, value)
    if kind in _FLOATS:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise TypeError
        return float(value)
    if isinstance(value, bool) != (kind == "boolean") or isinstance(value, dict | list) or value is None:
        raise TypeError
    return value if kind == "boolean" else str(value)


def _integer(kind: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    bits, is_signed = _INTEGERS[kind], kind.startswith("int")
    low, high = (-(1 << bits - 1), 1 << bits - 1) if is_signed else (0, 1 << bits)
    if not low <= value < high:
        raise ValueError
    return value


def _is_message(kind: str) -> bool:
    return "/" in kind and not _ARRAY.fullmatch(kind)


def plain(value: Any, longest: int | None = None) -> Any:
    """Message or value of a field as mappings, lists and scalars.

    Args:
        value: The message or value.
        longest: Length at which texts and arrays are cut off; None for never.
    """
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name), longest) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        value = list(value)
    elif hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, str):
        return value if longest is None or len(value) <= longest else value[:longest] + "..."
    if isinstance(value, list | tuple):
        items = [plain(each, longest) for each in value[:longest]]
        return items if len(items) == len(value) else [*items, "..."]
    return value


def yaml_text(value: Any) -> str:
    """YAML text, block style, with fields in their order."""
    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False
    writer.allow_unicode = True
    writer.width = 1 << 30
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    stream = io.StringIO()
    writer.dump(value, stream)
    text = stream.getvalue()
    # After a scalar alone, a line says that the document ends.
    return text.removesuffix("...\n") if text.endswith("\n...\n") else text
