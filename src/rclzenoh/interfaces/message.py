"""Message classes, made from their structures.

They behave like the classes that rosidl generates for Python: keyword arguments, nested defaults, mutable fields,
constants as class attributes. Number sequences are always numpy arrays of the field's type, even if they were set to
lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
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
_ZEROS = {"string": '""', "bool": "False", "float32": "0.0", "float64": "0.0"}


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
    is_free = field.length is None and field.bound is None
    if is_free and isinstance(value, np.ndarray) and value.dtype == dtype and value.ndim == 1 and value.flags.carray:
        return value
    is_octets = isinstance(value, (bytes, bytearray))
    array = np.frombuffer(value, np.uint8).copy() if is_octets else np.asarray(value)
    if dtype.kind in "iu" and array.size and array.dtype.kind in "fO" and all(isinstance(item, int) for item in value):
        # NumPy chooses int64 for 0 and uint64 for 2**63, so it makes floats or objects of a list with both.
        info = np.iinfo(dtype.name)
        if min(value) < info.min or max(value) > info.max:
            raise ValueError(f"{where}.{field.name}: {value!r:.80} does not fit {field.type}")
        array = np.array(value, dtype)
    if array.dtype != dtype:
        given = array
        if given.size and (given.dtype.kind not in "biuf" or (given.dtype.kind == "f") > (dtype.kind == "f")):
            raise TypeError(f"{where}.{field.name}: expected numbers of type {field.type}, got {value!r:.80}")
        with np.errstate(all="ignore"):
            array = given.astype(dtype)
        # A number that is too large has become another integer, or an infinite float.
        fits = np.array_equal(array, given) if dtype.kind in "biu" else (np.isfinite(array) == np.isfinite(given)).all()
        if not fits:
            raise ValueError(f"{where}.{field.name}: {value!r:.80} does not fit {field.type}")
    if array.ndim != 1:
        raise TypeError(f"{where}.{field.name}: expected one dimension, got shape {array.shape}")
    if field.length is not None and array.size != field.length:
        raise ValueError(f"{where}.{field.name}: expected {field.length} numbers, got {array.size}")
    if field.sequence and field.bound is not None and array.size > field.bound:
        raise ValueError(f"{where}.{field.name}: expected at most {field.bound} numbers, got {array.size}")
    return np.ascontiguousarray(array)


def _make_array_property(where: str, field: Field) -> property:
    slot = f"_{field.name}"

    def assign(message: Message, value: Any) -> None:
        object.__setattr__(message, slot, as_numbers(value, field, where))

    return property(attrgetter(slot), assign)


def _make_initialiser(fields: tuple[Field, ...]) -> Callable[..., None]:
    """``__init__`` written out, because a generic one costs a microsecond per field."""
    known = [field.name for field in fields]

    def reject(message: Message, unknown: Iterable[str]) -> None:
        raise TypeError(f"{message.TYPE} has no field {', '.join(map(repr, unknown))}; known: {', '.join(known)}")

    namespace: dict[str, Any] = {"reject": reject}
    arguments = "".join(f"{name}=None, " for name in known)
    lines = [f"def __init__(self, {'*, ' if known else ''}{arguments}**unknown):", " if unknown: reject(self, unknown)"]
    for number, field in enumerate(fields):
        name = field.name
        if is_numbers(field):
            zeros = np.zeros(field.length or 0, DTYPES[field.type])
            # All empty sequences of a class share one array, because it has no element that could be changed.
            namespace[f"zeros{number}"] = zeros
            copy = ".copy()" if field.length else ""
            lines += [f" if {name} is None: self._{name} = zeros{number}{copy}", f" else: self.{name} = {name}"]
            continue
        if field.nested:
            namespace[f"class{number}"] = message_class(field.type)
        element = f"class{number}()" if field.nested else _ZEROS.get(field.type, "0")
        if field.default is not None:
            element = repr(float(field.default) if field.type.startswith("float") else field.default)
        if field.length is not None:
            element = f"[{element} for _ in range({field.length})]"
        elif field.sequence:
            element = "[]"
        lines.append(f" self.{name} = {element} if {name} is None else {name}")
    exec("\n".join(lines), namespace)  # noqa: S102 - names come from the definitions, nothing from outside
    initialiser: Callable[..., None] = namespace["__init__"]
    return initialiser


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
