"""The six services by which other nodes read and change a node's parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rclzenoh.exceptions import ParameterException
from rclzenoh.interfaces.msg import Parameter as ParameterMessage
from rclzenoh.interfaces.msg import SetParametersResult
from rclzenoh.interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclzenoh.logging import Logger
from rclzenoh.node_endpoints import NodeEndpoints
from rclzenoh.node_parameters import NodeParameters
from rclzenoh.parameter import Parameter
from rclzenoh.qos import qos_profile_parameters

_T = TypeVar("_T")


def offer_parameters(node: NodeEndpoints, parameters: NodeParameters) -> None:
    """Let other nodes read and change a node's parameters.

    A request that names an unknown parameter is answered with an empty list, as rclpy's nodes do.
    """
    answers = _Answers(parameters, node.get_logger())
    for service, name, answer in (
        (DescribeParameters, "describe_parameters", answers.describe),
        (GetParameters, "get_parameters", answers.get),
        (GetParameterTypes, "get_parameter_types", answers.get_types),
        (ListParameters, "list_parameters", answers.list_names),
        (SetParameters, "set_parameters", answers.set),
        (SetParametersAtomically, "set_parameters_atomically", answers.set_atomically),
    ):
        node.create_service(service, f"~/{name}", answer, qos_profile=qos_profile_parameters)


class _Answers:
    def __init__(self, parameters: NodeParameters, logger: Logger) -> None:
        self._parameters = parameters
        self._logger = logger

    def describe(
        self, request: DescribeParameters.Request, response: DescribeParameters.Response
    ) -> DescribeParameters.Response:
        response.descriptors = self._read_each(request.names, self._parameters.describe_parameter)
        return response

    def get(self, request: GetParameters.Request, response: GetParameters.Response) -> GetParameters.Response:
        response.values = self._read_each(
            request.names, lambda name: self._parameters.get_parameter(name).get_parameter_value()
        )
        return response

    def get_types(
        self, request: GetParameterTypes.Request, response: GetParameterTypes.Response
    ) -> GetParameterTypes.Response:
        response.types = self._read_each(request.names, self._find_type)
        return response

    def _find_type(self, name: str) -> int:
        # `describe_parameter` raises an error if the parameter is not declared. One without a value is no error.
        self._parameters.describe_parameter(name)
        return int(self._parameters.get_parameter_or(name).type_.value)

    def _read_each(self, names: list[str], read: Callable[[str], _T]) -> list[_T]:
        try:
            return [read(name) for name in names]
        except ParameterException as error:
            self._logger.warning(f"parameter service: {error.message}")
            return []

    def list_names(self, request: ListParameters.Request, response: ListParameters.Response) -> ListParameters.Response:
        response.result = self._parameters.list_parameters(request.prefixes, request.depth)
        return response

    def set(self, request: SetParameters.Request, response: SetParameters.Response) -> SetParameters.Response:
        response.results = [self._try([parameter]) for parameter in request.parameters]
        return response

    def set_atomically(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        response.result = self._try(request.parameters)
        return response

    def _try(self, messages: list[ParameterMessage]) -> SetParametersResult:
        try:
            return self._parameters.set_parameters_atomically(
                [Parameter.from_parameter_msg(message) for message in messages]
            )
        except (ParameterException, ValueError) as error:
            self._logger.warning(f"parameter service: {error}")
            return SetParametersResult(successful=False, reason=str(error))
