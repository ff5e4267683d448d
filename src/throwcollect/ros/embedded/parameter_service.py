"""The six services by which other nodes read and change a node's parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from throwcollect.interfaces import Message, get_service
from throwcollect.ros.embedded.exceptions import ParameterException
from throwcollect.ros.embedded.parameter import Parameter, SetParametersResult
from throwcollect.ros.embedded.qos import qos_profile_parameters

if TYPE_CHECKING:
    from throwcollect.ros.embedded.node import Node


class ParameterService:
    """Offers a node's parameters.

    A request that names an unknown parameter is answered with an empty list, as rclpy's nodes do.

    Args:
        node: The node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        for service, callback in (
            ("DescribeParameters", self._describe),
            ("GetParameters", self._get),
            ("GetParameterTypes", self._get_types),
            ("ListParameters", self._list),
            ("SetParameters", self._set),
            ("SetParametersAtomically", self._set_atomically),
        ):
            name = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in service).strip("_")
            service_type = get_service(f"rcl_interfaces/srv/{service}")
            node.create_service(service_type, f"~/{name}", callback, qos_profile=qos_profile_parameters)

    def _describe(self, request: Message, response: Message) -> Message:
        response.descriptors = self._each(request.names, self._node.describe_parameter)
        return response

    def _get(self, request: Message, response: Message) -> Message:
        response.values = self._each(request.names, lambda name: self._node.get_parameter(name).get_parameter_value())
        return response

    def _get_types(self, request: Message, response: Message) -> Message:
        types = self._each(request.names, lambda name: self._node.describe_parameter(name) and self._type_of(name))
        response.types = types
        return response

    def _type_of(self, name: str) -> int:
        return int(self._node.get_parameter_or(name).type_.value)

    def _each(self, names: list[str], read: Callable[[str], object]) -> list[object]:
        try:
            return [read(name) for name in names]
        except ParameterException as error:
            self._node.get_logger().warning(f"parameter service: {error.message}")
            return []

    def _list(self, request: Message, response: Message) -> Message:
        response.result = self._node.list_parameters(request.prefixes, request.depth)
        return response

    def _set(self, request: Message, response: Message) -> Message:
        response.results = [self._try([parameter]) for parameter in request.parameters]
        return response

    def _set_atomically(self, request: Message, response: Message) -> Message:
        response.result = self._try(request.parameters)
        return response

    def _try(self, messages: list[Message]) -> Message:
        try:
            return self._node.set_parameters_atomically([Parameter.from_parameter_msg(message) for message in messages])
        except (ParameterException, ValueError) as error:
            self._node.get_logger().warning(f"parameter service: {error}")
            return SetParametersResult(successful=False, reason=str(error))
