"""The service by which other nodes learn how the types that a node uses are defined."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from throwcollect.interfaces import Message, get_service, type_hash
from throwcollect.interfaces.type_description import type_description, type_sources
from throwcollect.ros.embedded.keys import EntityKind
from throwcollect.ros.embedded.parameter import ParameterDescriptor

if TYPE_CHECKING:
    from throwcollect.ros.embedded.node import Node

PARAMETER = "start_type_description_service"
_HASH = re.compile(r"RIHS01_[0-9a-fA-F]{64}")
_GOAL_SERVICE = "_SendGoal"
_ENDPOINTS = (EntityKind.PUBLISHER, EntityKind.SUBSCRIPTION, EntityKind.SERVICE, EntityKind.CLIENT)


class TypeDescriptionService:
    """Offers ``~/get_type_description``, unless the node's parameter says no.

    Args:
        node: The node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        if not node.has_parameter(PARAMETER):
            description = "If enabled, start the ~/get_type_description service."
            node.declare_parameter(PARAMETER, True, ParameterDescriptor(description=description, read_only=True))
        if node.get_parameter(PARAMETER).value:
            service_type = get_service("type_description_interfaces/srv/GetTypeDescription")
            node.create_service(service_type, "~/get_type_description", self._describe)

    def _describe(self, request: Message, response: Message) -> Message:
        if not _HASH.fullmatch(request.type_hash):
            response.failure_reason = "Failed to parse type hash"
            return response
        wanted = request.type_hash.lower().replace("rihs", "RIHS")
        name = next((name for name in self._types() if type_hash(name) == wanted), None)
        if name is None:
            response.failure_reason = "Type not currently in use by this node"
            return response
        response.type_description = type_description(name)
        if request.include_type_sources:
            response.type_sources = type_sources(name)
        response.successful = True
        return response

    def _types(self) -> set[str]:
        """Types of the node's endpoints, and of the actions that they are parts of."""
        node = self._node.token
        tokens = self._node.context.graph.tokens(*_ENDPOINTS)
        names = {token.ros_type for token in tokens if (token.session, token.node_id) == (node.session, node.node_id)}
        return names | {name.removesuffix(_GOAL_SERVICE) for name in names if name.endswith(_GOAL_SERVICE)}
