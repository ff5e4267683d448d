"""Message classes, made from their structures.

They behave like the classes that rosidl generates for Python: keyword arguments, nested defaults, mutable fields,
constants as class attributes. Number sequences are always numpy arrays of the field's type, even if they were set to
lists.
"""

from __future__ import annotations

import array
from collections.abc import Callable
from functools import cache, partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from rclzenoh.interfaces.catalog import Field, structure

DTYPES = {
    **{name: np.dtype(name) for name in ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")},
    **{name: np.dtype(name) for name in ("float32", "float64")},
    "bool": np.dtype(np.bool_),
    "byte": np.dtype(np.uint8),
}
"""Array type of each primitive number."""

_IDL_NAMES = {"float64": "double", "float32": "float", "bool": "boolean", "byte": "octet"}
CODES = {**{name: dtype.char for name, dtype in DTYPES.items()}, "int64": "q", "uint64": "Q"}
"""Format character of each primitive number in `struct` and `array`, which has none for truth values."""


class Message:
    """Base of all message classes."""

    __slots__ = ()
    TYPE: ClassVar[str]
    FIELDS: ClassVar[tuple[Field, ...]]

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Names and IDL types of the fields, in order."""
        return {field.name: _write_idl_type(field) for field in cls.FIELDS}

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        pairs = ((getattr(self, field.name), getattr(other, field.name)) for field in self.FIELDS)
        return all(np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b for a, b in pairs)

    __hash__ = None  # type: ignore[assignment]  # mutable

    def __repr__(self) -> str:
        fields = ", ".join(f"{field.name}={_convert_to_plain(getattr(self, field.name))!r}" for field in self.FIELDS)
        return f"{self.TYPE.replace('/', '.')}({fields})"


if TYPE_CHECKING:

    class _Constants(type):
        def __getattr__(cls, name: str) -> Any: ...

    class AnyMessage(Message, metaclass=_Constants):
        """A message whose type is only known at run time, so that type checkers know nothing of its fields."""

        def __init__(self, **fields: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...
        def __setattr__(self, name: str, value: Any) -> None: ...

else:
    AnyMessage = Message


def is_numbers(field: Field) -> bool:
    """Whether a field is a sequence or array of numbers, so that it is kept as a numpy array in ``_<name>``."""
    return (field.sequence or field.length is not None) and field.type in DTYPES


@cache
def message_class(name: str) -> type[AnyMessage]:
    """Class of a message, or of a part of a service or action such as ``std_srvs/srv/Trigger_Response``."""
    definition = structure(name)
    members: dict[str, Any] = {
        "__slots__": tuple(f"_{field.name}" if is_numbers(field) else field.name for field in definition.fields),
        "TYPE": name,
        "FIELDS": definition.fields,
        **definition.constants,
    }
    for field in definition.fields:
        if is_numbers(field):
            members[field.name] = _make_array_property(name, field)
    members["__init__"] = _make_initialiser(definition.fields)
    package, _, rest = name.partition("/")
    members["__module__"] = f"{package}.{rest.partition('/')[0]}"
    return type(rest.partition("/")[2], (AnyMessage,), members)


def as_numbers(value: Any, field: Field, where: str) -> NDArray[Any]:
    """Value of a number sequence as a contiguous one-dimensional array of the field's type; itself if it is one.

    The value is an array, a list, a tuple, an ``array.array``, or bytes for octets. Errors begin with ``where``, the
    name of the structure that has the field.
    """
    dtype = DTYPES[field.type]
    try:
        if isinstance(value, np.ndarray) and value.dtype == dtype:
            numbers = np.ascontiguousarray(value)
        elif field.type == "bool":
            numbers = np.array([{True: True, False: False}[item] for item in value], dtype)
        else:
            # NumPy would cut off fractions, and read numbers in strings.
            octets = isinstance(value, bytes | bytearray) and CODES[field.type] == "B"
            numbers = np.asarray(array.array(CODES[field.type], value if octets else list(value)))
    except (TypeError, KeyError) as error:
        raise TypeError(f"{where}.{field.name}: expected {field.type}, got {value!r:.80}") from error
    except OverflowError as error:
        raise ValueError(f"{where}.{field.name}: {value!r:.80} does not fit {field.type}") from error
    if numbers.ndim != 1:
        raise TypeError(f"{where}.{field.name}: expected one dimension, got shape {numbers.shape}")
    if field.length not in (None, numbers.size) or (field.bound is not None and numbers.size > field.bound):
        expected = field.length or f"at most {field.bound}"
        raise ValueError(f"{where}.{field.name}: expected {expected} numbers, got {numbers.size}")
    return numbers


def _make_array_property(where: str, field: Field) -> property:
    slot = f"_{field.name}"

    def assign(message: Message, value: Any) -> None:
        object.__setattr__(message, slot, as_numbers(value, field, where))

    return property(attrgetter(slot), assign)


def _make_initialiser(fields: tuple[Field, ...]) -> Callable[..., None]:
    makers = {field.name: _make_default(field) for field in fields}

    def initialise(self: Message, **values: Any) -> None:
        for name, make in makers.items():
            value = values.pop(name, None)
            setattr(self, name, make() if value is None else value)
        if values:
            known = ", ".join(makers)
            raise TypeError(f"{self.TYPE} has no field {', '.join(map(repr, values))}; known: {known}")

    return initialise


def _make_default(field: Field) -> Callable[[], Any]:
    """Make the function that makes the value of a field that is not set."""
    if is_numbers(field):
        return partial(np.zeros, field.length or 0, DTYPES[field.type])
    if field.sequence:
        return list
    if field.nested:
        make: Callable[[], Any] = message_class(field.type)
    else:
        kind: Any = str if field.type == "string" else type(DTYPES[field.type].type().item())
        make = partial(kind, *() if field.default is None else (field.default,))
    return make if field.length is None else lambda: [make() for _ in range(field.length or 0)]


def _convert_to_plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _write_idl_type(field: Field) -> str:
    name = field.type.replace("/msg/", "/") if field.nested else _IDL_NAMES.get(field.type, field.type)
    if field.type == "string" and field.bound is not None and not field.sequence:
        name = f"string<{field.bound}>"
    if field.length is not None:
        return f"{name}[{field.length}]"
    if field.sequence:
        return f"sequence<{name}{f', {field.bound}' if field.bound is not None else ''}>"
    return name
