"""The parameters of a node, with the methods that rclpy's nodes have, and the services by which others change them."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from rclzenoh.exceptions import (
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterException,
    ParameterNotDeclaredException,
)
from rclzenoh.interfaces import AnyMessage, Service
from rclzenoh.interfaces.msg import (
    ListParametersResult,
    ParameterDescriptor,
    ParameterEvent,
    ParameterValue,
    SetParametersResult,
)
from rclzenoh.interfaces.msg import Parameter as ParameterMessage
from rclzenoh.interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclzenoh.parameter import Parameter, ParameterKind

_RELATIVE_TOLERANCE = 1e-6
"""A value this close to a bound or a step of its range counts as equal to it; rclpy has the same tolerance."""


class NodeParameters:
    """Parameters that were declared, and the rules for setting them.

    Args:
        announce: Adds node and stamp to the event of a change, and publishes it.
    """

    def __init__(self, announce: Callable[[ParameterEvent], None]) -> None:
        self._announce = announce
        self._parameters: dict[str, Parameter] = {}
        self._descriptors: dict[str, ParameterDescriptor] = {}
        self._on_set: list[Callable[[list[Parameter]], SetParametersResult]] = []
        self._post_set: list[Callable[[list[Parameter]], None]] = []

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: ParameterDescriptor | None = None
    ) -> Parameter:
        """Declare a parameter with a default value; rclpy also takes a type in its place.

        Without a descriptor, the parameter keeps the type that it is declared with.
        """
        if name in self._parameters:
            raise ParameterAlreadyDeclaredException(f"parameter {name!r} is declared already")
        # The descriptor is copied, because name and type are set here, and the caller may use it for other parameters.
        described = ParameterDescriptor() if descriptor is None else copy.copy(descriptor)
        described.name = name
        described.type = ParameterKind.from_parameter_value(value).value
        if described.type == ParameterKind.NOT_SET.value and not described.dynamic_typing:
            raise ValueError(f"parameter {name!r}: give a default value, or a descriptor with dynamic_typing")
        result = self._set([Parameter(name, value=value)], {name: described})
        if not result.successful:
            raise InvalidParameterValueException(f"parameter {name!r} cannot be {value!r}: {result.reason}")
        return self._parameters[name]

    def has_parameter(self, name: str) -> bool:
        """Whether a parameter is declared."""
        return name in self._parameters

    def get_parameter(self, name: str) -> Parameter:
        """A parameter with its value."""
        self.describe_parameter(name)
        return self._parameters[name]

    def describe_parameter(self, name: str) -> ParameterDescriptor:
        """Descriptor of a parameter."""
        if name not in self._descriptors:
            raise ParameterNotDeclaredException(f"parameter {name!r} is not declared")
        return self._descriptors[name]

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[SetParametersResult]:
        """Set parameters one after the other, up to the first that is not declared; returns a result for each."""
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> SetParametersResult:
        """Set parameters all at once, or none of them; the result has the reason."""
        for parameter in parameter_list:
            self.describe_parameter(parameter.name)
        return self._set(list(parameter_list), None)

    def add_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], SetParametersResult]) -> None:
        """Add a callback to be called before parameters are set; the last one added is called first."""
        self._on_set.insert(0, callback)

    def add_post_set_parameters_callback(self, callback: Callable[[list[Parameter]], None]) -> None:
        """Add a callback to be called after parameters were set; the last one added is called first."""
        self._post_set.insert(0, callback)

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> ListParametersResult:
        """Names of parameters and their prefixes.

        Args:
            prefixes: Names and prefixes to list; empty for all.
            depth: Number of name parts below a prefix; 0 for any number.
        """
        everything = depth == ListParameters.Request.DEPTH_RECURSIVE

        def is_listed(name: str) -> bool:
            if not prefixes:
                return everything or name.count(".") < depth
            return any(
                name == prefix
                or (name.startswith(prefix + ".") and (everything or name[len(prefix) + 1 :].count(".") < depth))
                for prefix in prefixes
            )

        names = [name for name in self._parameters if is_listed(name)]
        nested = dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)
        return ListParametersResult(names=names, prefixes=list(nested))

    def parameter_services(
        self, warn: Callable[[str], object]
    ) -> Iterator[tuple[type[Service], str, str, Callable[[AnyMessage], object]]]:
        """Services by which other nodes read and change the parameters; ``warn`` logs why a request fails.

        Each has its type, its name, the field of the response, and a function of the request that gives this field. A
        request that names an unknown parameter is answered with an empty list, as rclpy's nodes do.
        """

        def read_each(names: list[str], read: Callable[[str], object]) -> list[object]:
            try:
                return [read(name) for name in names]
            except ParameterException as error:
                warn(f"parameter service: {error}")
                return []

        def find_type(name: str) -> int:
            return int(self.get_parameter(name).type_.value)

        def find_value(name: str) -> ParameterValue:
            return self.get_parameter(name).get_parameter_value()

        def set_each(messages: list[ParameterMessage]) -> list[SetParametersResult]:
            return [set_all([message]) for message in messages]

        def set_all(messages: list[ParameterMessage]) -> SetParametersResult:
            try:
                return self.set_parameters_atomically([Parameter.from_parameter_msg(message) for message in messages])
            except (ParameterException, ValueError) as error:
                warn(f"parameter service: {error}")
                return SetParametersResult(successful=False, reason=str(error))

        describe, list_names = self.describe_parameter, self.list_parameters
        yield DescribeParameters, "describe_parameters", "descriptors", lambda asked: read_each(asked.names, describe)
        yield GetParameters, "get_parameters", "values", lambda asked: read_each(asked.names, find_value)
        yield GetParameterTypes, "get_parameter_types", "types", lambda asked: read_each(asked.names, find_type)
        yield ListParameters, "list_parameters", "result", lambda asked: list_names(asked.prefixes, asked.depth)
        yield SetParameters, "set_parameters", "results", lambda asked: set_each(asked.parameters)
        yield SetParametersAtomically, "set_parameters_atomically", "result", lambda asked: set_all(asked.parameters)

    def _set(self, parameters: list[Parameter], declared: dict[str, ParameterDescriptor] | None) -> SetParametersResult:
        """Set parameters, if descriptors and callbacks agree; ``declared`` has the descriptors of new ones."""
        descriptors = self._descriptors if declared is None else declared
        for parameter in parameters:
            if reason := find_refusal(parameter, descriptors[parameter.name], is_declared=declared is None):
                return SetParametersResult(successful=False, reason=reason)
        # All parameters are set or none: nothing is stored before descriptors and callbacks have accepted each of them.
        for callback in list(self._on_set):
            result = callback(parameters)
            if not result.successful:
                return result
        event = ParameterEvent()
        for parameter in parameters:
            name, message = parameter.name, parameter.to_parameter_msg()
            # As in rclpy, setting a parameter to no value undeclares it.
            if declared is None and parameter.type_ is ParameterKind.NOT_SET:
                self._parameters.pop(name, None)
                self._descriptors.pop(name, None)
                event.deleted_parameters.append(message)
                continue
            is_new = name not in self._parameters or self._parameters[name].type_ is ParameterKind.NOT_SET
            (event.new_parameters if is_new else event.changed_parameters).append(message)
            self._descriptors[name] = descriptors[name]
            if self._descriptors[name].dynamic_typing:
                self._descriptors[name].type = parameter.type_.value
            self._parameters[name] = parameter
        self._announce(event)
        for post in list(self._post_set):
            post(parameters)
        return SetParametersResult(successful=True)


def find_refusal(parameter: Parameter, descriptor: ParameterDescriptor, *, is_declared: bool) -> str | None:
    """Find why a parameter may not get a new value (its first one, if it is not declared yet); None if it may."""
    if is_declared and descriptor.read_only:
        return f"Trying to set a read-only parameter: {parameter.name}."
    if not descriptor.dynamic_typing:
        if is_declared and parameter.type_ is ParameterKind.NOT_SET:
            return "Static parameter cannot be undeclared"
        if parameter.type_ is not ParameterKind.NOT_SET and parameter.type_.value != descriptor.type:
            expected = ParameterKind(descriptor.type).name
            return f"Wrong parameter type of {parameter.name}, expected {expected}, got {parameter.type_.name}"
    ranges: dict[ParameterKind, Sequence[Any]] = {
        ParameterKind.INTEGER: descriptor.integer_range,
        ParameterKind.DOUBLE: descriptor.floating_point_range,
    }
    is_integer, value = parameter.type_ is ParameterKind.INTEGER, parameter.value

    def is_at(mark: float) -> bool:
        return bool(value == mark if is_integer else math.isclose(value, mark, rel_tol=_RELATIVE_TOLERANCE))

    for span in ranges.get(parameter.type_, ()):
        low, high = sorted((span.from_value, span.to_value))
        if not (low < value < high or is_at(low) or is_at(high)):
            return f"Parameter {parameter.name} out of range. Min: {low}, max: {high}, value: {value}"
        if span.step and not is_at(high):
            steps = (value - low) // span.step if is_integer else round((value - low) / span.step)
            if not is_at(low + steps * span.step):
                return f"{value} of parameter {parameter.name} is no step of {span.step} from {low}"
    return None
