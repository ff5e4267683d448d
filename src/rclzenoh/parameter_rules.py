"""The values that the descriptor of a parameter allows."""

from __future__ import annotations

import math

from rclzenoh.interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclzenoh.parameter import Parameter, ParameterKind

_RELATIVE_TOLERANCE = 1e-6
"""A value this close to a bound or a step of its range counts as equal to it; rclpy has the same tolerance."""


def check(parameter: Parameter, descriptor: ParameterDescriptor, *, is_declared: bool) -> SetParametersResult:
    """Check whether a parameter may get a new value (its first one, if it is not declared yet); if not, say why."""
    if is_declared and descriptor.read_only:
        return _refuse(f"Trying to set a read-only parameter: {parameter.name}.")
    if not descriptor.dynamic_typing:
        if is_declared and parameter.type_ is ParameterKind.NOT_SET:
            return _refuse("Static parameter cannot be undeclared")
        if parameter.type_ is not ParameterKind.NOT_SET and parameter.type_.value != descriptor.type:
            expected = ParameterKind(descriptor.type).name
            return _refuse(f"Wrong parameter type of {parameter.name}, expected {expected}, got {parameter.type_.name}")
    if parameter.type_ is ParameterKind.INTEGER and len(descriptor.integer_range):
        return _check_integer(parameter, descriptor.integer_range[0])
    if parameter.type_ is ParameterKind.DOUBLE and len(descriptor.floating_point_range):
        return _check_double(parameter, descriptor.floating_point_range[0])
    return SetParametersResult(successful=True)


def _refuse(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)


def _check_integer(parameter: Parameter, allowed: IntegerRange) -> SetParametersResult:
    low, high = sorted((allowed.from_value, allowed.to_value))
    value = parameter.value
    if not low <= value <= high:
        return _refuse(f"Parameter {parameter.name} out of range. Min: {low}, max: {high}, value: {value}")
    if value not in (low, high) and allowed.step and (value - low) % allowed.step:
        return _refuse(f"{value} of parameter {parameter.name} is no step of {allowed.step} from {low}")
    return SetParametersResult(successful=True)


def _check_double(parameter: Parameter, allowed: FloatingPointRange) -> SetParametersResult:
    low, high = sorted((allowed.from_value, allowed.to_value))
    value = parameter.value
    if any(math.isclose(value, bound, rel_tol=_RELATIVE_TOLERANCE) for bound in (low, high)):
        return SetParametersResult(successful=True)
    if not low < value < high:
        return _refuse(f"Parameter {parameter.name} out of range. Min: {low}, max: {high}, value: {value}")
    if allowed.step:
        nearest = low + round((value - low) / allowed.step) * allowed.step
        if not math.isclose(nearest, value, rel_tol=_RELATIVE_TOLERANCE):
            return _refuse(f"{value} of parameter {parameter.name} is no step of {allowed.step} from {low}")
    return SetParametersResult(successful=True)
