"""Turns messages into plain values and back: mappings by field, lists and scalars, as in YAML, JSON and CBOR."""

from __future__ import annotations

import array
import base64
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces.message import CODES
from throwcollect.errors import ConfigError
from throwcollect.ros import get_message
from throwcollect.wording import suggest

Numbers = Callable[[NDArray[Any], str], Any]
"""Makes a plain value of an array of numbers and the IDL type of its elements."""

_ARRAY = re.compile(r"(?:sequence<(?P<element>.+?)(?:, (?P<most>\d+))?>|(?P<item>.+)\[(?P<length>\d+)\])")
_CODES: dict[str, Any] = {**CODES, "octet": "B", "float": "f", "double": "d"}
"""Format character of each type of numbers in `array`; those of integers have the same names in IDL."""
_FLOATS = ("float", "double")
_OCTETS = ("octet", "uint8")
_ROS_1_NAMES = {"secs": "sec", "nsecs": "nanosec"}


def fill(message: Any, values: object, where: str = "") -> None:
    """Set fields of a message.

    Args:
        message: The message.
        values: Mapping of field names to values; nested messages are mappings, too. Null is the number NaN, octets may
            be bytes or Base64, arrays may be NumPy's, and fields of times may have the names that they have in ROS 1.
        where: Path of this message inside the whole message, with a dot at its end.
    """
    types = _field_types(message.__class__)
    if not isinstance(values, Mapping):
        raise ConfigError(
            f"{where.rstrip('.') or 'values'}: should be fields with values, got {values!r:.80}",
            expected="{" + ", ".join(f"{name}: {kind}" for name, kind in types.items()) + "}",
        )
    for given, value in values.items():
        name = str(_ROS_1_NAMES.get(given, given) if "nanosec" in types else given)
        path = f"{where}{given}"
        if name not in types:
            raise ConfigError(f"{path}: no such field{suggest(name, types)}")
        current = getattr(message, name)
        if _is_message(types[name]):
            fill(current, value, f"{path}.")
            continue
        try:
            setattr(message, name, _convert(types[name], value, path, current))
        # Classes that rosidl generates check fields by assertions. A number that no float can hold overflows.
        except (TypeError, ValueError, AssertionError, OverflowError) as error:
            raise ConfigError(f"{path}: should be {types[name]}, got {value!r:.80}") from error


def plain(value: Any, numbers: Numbers = lambda values, _: values.tolist(), kind: str = "") -> Any:
    """Message or value of a field as mappings, lists and scalars.

    Args:
        value: The message or value.
        numbers: Makes something else of arrays of numbers than lists.
        kind: IDL type of the field; empty for a message.
    """
    if isinstance(value, np.ndarray):
        return value.tolist() if value.dtype == np.bool_ else numbers(value, _element(kind))
    if isinstance(value, array.array):
        return numbers(np.frombuffer(value, value.typecode), _element(kind))
    if isinstance(value, bytes):
        # In rclpy, a single octet is a `bytes` object of length 1.
        return value[0] if kind == "octet" else list(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        element = _element(kind)
        if element == "octet":
            return numbers(np.frombuffer(b"".join(value), np.uint8), "octet")
        return list(value) if element and "/" not in element else [plain(item, numbers) for item in value]
    if hasattr(value, "get_fields_and_field_types"):
        types = _field_types(value.__class__)
        return {name: plain(getattr(value, name), numbers, field) for name, field in types.items()}
    return value


@cache
def _field_types(message_class: Any) -> Mapping[str, str]:
    types: Mapping[str, str] = message_class.get_fields_and_field_types()
    return types


@cache
def array_parts(kind: str) -> tuple[str, int | None, int | None] | None:
    """Type of an array's elements, its bound and its fixed length, at most one of which is set; None if no array."""
    match = _ARRAY.fullmatch(kind)
    if match is None:
        return None
    most, length = (int(match[name]) if match[name] else None for name in ("most", "length"))
    return match["element"] or match["item"], most, length


def _element(kind: str) -> str:
    parts = array_parts(kind)
    return parts[0] if parts else ""


def _convert(kind: str, value: Any, path: str, current: Any = None) -> Any:
    if parts := array_parts(kind):
        element, most, length = parts
        if element in _CODES or element == "boolean":
            values = _numbers(element, value, current)
        elif isinstance(value, list):
            values = [_convert(element, item, f"{path}[{index}]") for index, item in enumerate(value)]
        else:
            raise TypeError
        if (most is not None and len(values) > most) or (length is not None and len(values) != length):
            raise ValueError
        return values
    if _is_message(kind):
        package, _, short = kind.partition("/")
        message = get_message(f"{package}/msg/{short}")()
        fill(message, value, f"{path}.")
        return message
    if isinstance(value, bool) != (kind == "boolean"):
        raise TypeError
    if kind == "boolean":
        return value
    if kind in _FLOATS and isinstance(value, int | float | None):
        return math.nan if value is None else float(value)
    if kind in _CODES:
        (number,) = array.array(_CODES[kind], [value])
        return bytes([number]) if isinstance(current, bytes) else number
    if isinstance(value, dict | list) or value is None:
        raise TypeError
    return str(value)


def _numbers(element: str, value: Any, current: Any) -> Any:
    """Numbers or truth values as the class of a message takes them; ``current`` is the value that it has."""
    if element in _OCTETS and isinstance(value, str):
        value = base64.b64decode(value, validate=True)
    elif element in _FLOATS and isinstance(value, list):
        value = [math.nan if each is None else each for each in value]
    is_octets = element in _OCTETS and isinstance(value, bytes | bytearray)
    if not is_octets and not isinstance(value, list | np.ndarray):
        raise TypeError
    if not is_octets:
        # For Python, truth values are integers, and 0 and 1 are truth values.
        kinds = {value.dtype.type} if isinstance(value, np.ndarray) else set(map(type, value))
        if any((kind in (bool, np.bool_)) != (element == "boolean") for kind in kinds):
            raise TypeError
    # Fields with numbers are `array.array` or lists on rclpy, and on the embedded backend NumPy arrays, which check.
    if isinstance(current, array.array):
        return array.array(current.typecode, value.tolist() if isinstance(value, np.ndarray) else value)
    return [bytes([octet]) for octet in value] if element == "octet" and isinstance(current, list) else value


def _is_message(kind: str) -> bool:
    return "/" in kind and array_parts(kind) is None
