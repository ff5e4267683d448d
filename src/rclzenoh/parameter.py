"""Parameters: a name, a type and a value."""

from __future__ import annotations

import array
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from rclzenoh.interfaces.msg import Parameter as ParameterMessage
from rclzenoh.interfaces.msg import ParameterValue


class ParameterKind(Enum):
    """Type of a parameter."""

    NOT_SET = 0
    BOOL = 1
    INTEGER = 2
    DOUBLE = 3
    STRING = 4
    BYTE_ARRAY = 5
    BOOL_ARRAY = 6
    INTEGER_ARRAY = 7
    DOUBLE_ARRAY = 8
    STRING_ARRAY = 9

    @classmethod
    def from_parameter_value(cls, value: object) -> ParameterKind:
        """Type that a Python value has as a parameter."""
        # An empty list fits all types of arrays. As in rclpy, it becomes an array of bytes, because that comes first.
        for kind in cls:
            if kind.check(value):
                return kind
        raise TypeError(f"{value!r:.80} is no value of a parameter")

    def check(self, value: object) -> bool:
        """Whether a Python value is of this type."""
        if self is ParameterKind.NOT_SET:
            return value is None
        if self.value in _SCALARS:
            # True is an int, too.
            return isinstance(value, _SCALARS[self.value]) and isinstance(value, bool) == (self is ParameterKind.BOOL)
        return isinstance(value, (list, tuple, array.array)) and all(
            isinstance(element, _ELEMENTS[self.value]) for element in value
        )

    @property
    def field(self) -> str:
        """Field of rcl_interfaces/msg/ParameterValue that holds such values."""
        return f"{self.name.lower()}_value"


_SCALARS: dict[int, type] = {1: bool, 2: int, 3: float, 4: str}
_ELEMENTS: dict[int, type] = {5: bytes, 6: bool, 7: int, 8: float, 9: str}


@dataclass
class Parameter:
    """A parameter. Values are bool, int, float, str, lists of these, or lists of single bytes.

    Attributes:
        name: Name, with dots between its parts.
        type_: Type; by default that of the value.
        value: Value; None together with `ParameterKind.NOT_SET`.
    """

    Type: ClassVar = ParameterKind

    name: str
    type_: ParameterKind = None  # type: ignore[assignment]  # set below
    value: Any = None

    def __post_init__(self) -> None:
        if self.type_ is None:
            self.type_ = ParameterKind.from_parameter_value(self.value)
        if not self.type_.check(self.value):
            raise ValueError(f"parameter {self.name!r}: {self.value!r:.80} is not of type {self.type_.name}")

    def get_parameter_value(self) -> ParameterValue:
        """The value as a message."""
        message = ParameterValue(type=self.type_.value)
        if self.type_ is ParameterKind.BYTE_ARRAY:
            message.byte_array_value = b"".join(self.value)
        elif self.type_ is not ParameterKind.NOT_SET:
            setattr(message, self.type_.field, list(self.value) if self.type_.value in _ELEMENTS else self.value)
        return message

    def to_parameter_msg(self) -> ParameterMessage:
        """The parameter as a message."""
        return ParameterMessage(name=self.name, value=self.get_parameter_value())

    @classmethod
    def from_parameter_msg(cls, param_msg: ParameterMessage) -> Parameter:
        """Parameter that a message holds."""
        type_ = ParameterKind(param_msg.value.type)
        return cls(param_msg.name, type_, parameter_value_to_python(param_msg.value))


def parameter_value_to_python(message: ParameterValue) -> Any:
    """Python value that a message holds; None if it is not set."""
    type_ = ParameterKind(message.type)
    if type_ is ParameterKind.NOT_SET:
        return None
    value = getattr(message, type_.field)
    if type_ is ParameterKind.BYTE_ARRAY:
        return [bytes([octet]) for octet in value]
    return value.tolist() if isinstance(value, np.ndarray) else value
