"""Makes descriptors of ROS parameters, which editors of parameters show, from what the configuration has of its keys.

A range in ROS includes its bounds. Where a bound itself is not allowed, or bounds depend on each other, the constraints
in words say so, and the node refuses the value.
"""

from __future__ import annotations

import re
import sys

from throwcollect.config.shape import shape_of
from throwcollect.ros import FloatingPointRange, IntegerRange, ParameterDescriptor

_LARGEST = sys.float_info.max
_LARGEST_INTEGER = 2**63 - 1


def floating_range(low: float | None, high: float | None) -> FloatingPointRange:
    """Make a rcl_interfaces/msg/FloatingPointRange; without a bound, it goes as far as finite numbers do."""
    return FloatingPointRange(
        from_value=-_LARGEST if low is None else float(low), to_value=_LARGEST if high is None else float(high)
    )


def integer_range(low: int | None, high: int | None) -> IntegerRange:
    """Make a rcl_interfaces/msg/IntegerRange; without a bound, it goes as far as 64 bits do."""
    return IntegerRange(
        from_value=-_LARGEST_INTEGER - 1 if low is None else low,
        to_value=_LARGEST_INTEGER if high is None else high,
        step=1,
    )


def of_key(key: str, value: object, *, read_only: bool = False) -> ParameterDescriptor:
    """Make the descriptor of the parameter that shows a dotted key; the type of its value decides the kind of range."""
    shape = shape_of(key)
    descriptor = ParameterDescriptor(
        description=_find_description(key), additional_constraints=str(shape), read_only=read_only
    )
    for option in shape.alternatives:
        node = option.node
        if node.get("type") not in ("number", "integer"):
            continue
        # An integer stays one away from a bound that is itself not allowed.
        step = 0 if isinstance(value, float) else 1
        low = node["exclusiveMinimum"] + step if "exclusiveMinimum" in node else node.get("minimum")
        high = node["exclusiveMaximum"] - step if "exclusiveMaximum" in node else node.get("maximum")
        if isinstance(value, float):
            descriptor.floating_point_range = [floating_range(low, high)]
        else:
            descriptor.integer_range = [integer_range(low, high)]
    return descriptor


def _find_description(key: str) -> str:
    """Find the description of a key; keys without one, such as those of single joints, get that of the key above."""
    while key:
        if text := shape_of(key).node.get("description"):
            return re.sub(r"\s+", " ", text)
        key = key.rpartition(".")[0]
    return ""
