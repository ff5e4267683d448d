"""Descriptors of ROS parameters, which editors of parameters show, from what the configuration says of its keys.

A range of ROS includes its bounds. Where a bound itself is not allowed, or bounds depend on each other, the constraints
in words say so, and the node refuses the value.
"""

from __future__ import annotations

import re
import sys
from typing import Any

from throwcollect.config.shape import ValueShape, shape_of
from throwcollect.ros import FloatingPointRange, IntegerRange, ParameterDescriptor

_LARGEST = sys.float_info.max
_LARGEST_INTEGER = 2**63 - 1


def floating_range(low: float | None, high: float | None) -> FloatingPointRange:
    """A rcl_interfaces/msg/FloatingPointRange; without a bound it goes as far as finite numbers do."""
    return FloatingPointRange(
        from_value=-_LARGEST if low is None else float(low), to_value=_LARGEST if high is None else float(high)
    )


def integer_range(low: int | None, high: int | None) -> IntegerRange:
    """A rcl_interfaces/msg/IntegerRange; without a bound it goes as far as 64 bits do."""
    return IntegerRange(
        from_value=-_LARGEST_INTEGER - 1 if low is None else low,
        to_value=_LARGEST_INTEGER if high is None else high,
        step=1,
    )


def of_key(key: str, value: object, *, read_only: bool = False) -> ParameterDescriptor:
    """Descriptor of the parameter that shows a dotted key; the type of its value decides the kind of range."""
    parts = [int(part) if part.isdecimal() else part for part in key.split(".")]
    shape = shape_of(parts)
    descriptor = ParameterDescriptor(
        description=_meaning(parts), additional_constraints=str(shape), read_only=read_only
    )
    number = next((option for option in shape.alternatives if option.node.get("type") in ("number", "integer")), None)
    if number is None:
        return descriptor
    low, high = _bounds(number, whole=isinstance(value, int))
    if low is None and high is None:
        return descriptor
    if isinstance(value, float):
        descriptor.floating_point_range = [floating_range(low, high)]
    else:
        descriptor.integer_range = [integer_range(low, high)]
    return descriptor


def _meaning(parts: list[str | int]) -> str:
    """Description of a key, or of the key that holds it where it has none, as those of single joints."""
    for length in range(len(parts), 0, -1):
        if text := shape_of(parts[:length]).node.get("description"):
            return re.sub(r"\s+", " ", text)
    return ""


def _bounds(number: ValueShape, *, whole: bool) -> tuple[Any, Any]:
    """Least and largest value, or the bound that neither reaches; None where there is no bound."""
    node, step = number.node, int(whole)
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    return (
        low if above is None else above + step,
        high if below is None else below - step,
    )
