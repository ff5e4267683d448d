"""What the configuration says of its keys, as descriptors of ROS parameters, which editors of parameters show.

A range of ROS has no open ends: where a bound itself is not allowed, or bounds depend on each other, the constraints in
words say so, and whoever is asked to set the value refuses it.
"""

from __future__ import annotations

import re
import sys
from typing import Any

from throwcollect.config.shape import Shape, shape_of
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
    """Descriptor of the parameter that shows a key of the configuration.

    Args:
        key: Dotted key.
        value: Value of the parameter, whose type decides the kind of range.
        read_only: Whether the parameter cannot be set.

    Returns:
        A rcl_interfaces/msg/ParameterDescriptor.
    """
    parts = [int(part) if part.isdecimal() else part for part in key.split(".")]
    shape = shape_of(parts)
    descriptor = ParameterDescriptor(
        description=_meaning(parts), additional_constraints=str(shape), read_only=read_only
    )
    number = next((each for each in shape.alternatives if each.node.get("type") in ("number", "integer")), None)
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
    """What a key says of itself, or the one above that holds it, as joints have no meaning of their own."""
    for length in range(len(parts), 0, -1):
        if text := shape_of(parts[:length]).node.get("description"):
            return re.sub(r"\s+", " ", text)
    return ""


def _bounds(number: Shape, *, whole: bool) -> tuple[Any, Any]:
    """Least and largest value, or the bound that neither reaches; None where there is no bound."""
    node, step = number.node, int(whole)
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    return (
        low if above is None else above + step,
        high if below is None else below - step,
    )
