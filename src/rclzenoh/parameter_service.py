"""The six services by which other nodes read and change a node's parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from rclzenoh.exceptions import ParameterException
from rclzenoh.interfaces import AnyMessage, Service
from rclzenoh.interfaces.msg import Parameter as ParameterMessage
from rclzenoh.interfaces.msg import ParameterValue, SetParametersResult
from rclzenoh.interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclzenoh.node_endpoints import NodeEndpoints
from rclzenoh.node_parameters import NodeParameters
from rclzenoh.parameter import Parameter
from rclzenoh.qos import qos_profile_parameters

_T = TypeVar("_T")


def offer_parameters(node: NodeEndpoints, parameters: NodeParameters) -> None:
    """Let other nodes read and change a node's parameters.

    A request that names an unknown parameter is answered with an empty list, as rclpy's nodes do.
    """

    def read_each(names: list[str], read: Callable[[str], _T]) -> list[_T]:
        try:
            return [read(name) for name in names]
        except ParameterException as error:
            node.get_logger().warning(f"parameter service: {error.message}")
            return []

    def find_type(name: str) -> int:
        # `describe_parameter` raises an error if the parameter is not declared. One without a value is no error.
        parameters.describe_parameter(name)
        return int(parameters.get_parameter_or(name).type_.value)

    def find_value(name: str) -> ParameterValue:
        return parameters.get_parameter(name).get_parameter_value()

    def set_together(messages: list[ParameterMessage]) -> SetParametersResult:
        try:
            return parameters.set_parameters_atomically([Parameter.from_parameter_msg(message) for message in messages])
        except (ParameterException, ValueError) as error:
            node.get_logger().warning(f"parameter service: {error}")
            return SetParametersResult(successful=False, reason=str(error))

    def offer(service: type[Service], name: str, field: str, find: Callable[[Any], object]) -> None:
        """Offer a service that answers with one field."""

        def answer(request: AnyMessage, response: AnyMessage) -> AnyMessage:
            setattr(response, field, find(request))
            return response

        node.create_service(service, f"~/{name}", answer, qos_profile=qos_profile_parameters)

    describe = parameters.describe_parameter
    offer(DescribeParameters, "describe_parameters", "descriptors", lambda asked: read_each(asked.names, describe))
    offer(GetParameters, "get_parameters", "values", lambda asked: read_each(asked.names, find_value))
    offer(GetParameterTypes, "get_parameter_types", "types", lambda asked: read_each(asked.names, find_type))
    offer(
        ListParameters,
        "list_parameters",
        "result",
        lambda asked: parameters.list_parameters(asked.prefixes, asked.depth),
    )
    offer(SetParameters, "set_parameters", "results", lambda asked: [set_together([each]) for each in asked.parameters])
    offer(SetParametersAtomically, "set_parameters_atomically", "result", lambda asked: set_together(asked.parameters))
