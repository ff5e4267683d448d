"""Calls of services by a client: how they are answered, and how those of nodes are called."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface, full_name
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.errands import Questions
from throwcollect.serve.rosbridge.guarded import refuse_secrets
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest, Fields, Form


class Call:
    """One call of a client, which is answered once.

    Attributes:
        given: The client's name for the service.
        arguments: Fields of the service's request, by name or in their order.
        form: How the answer is sent.

    Raises:
        ConfigError: If the request names no service.
    """

    def __init__(self, client: Peer, request: BridgeRequest) -> None:
        self._client = client
        self._id = request.id
        self.given = request.text("service")
        self.arguments: Any = request.any("args")
        self.form = Form()

    @property
    def fields(self) -> Fields:
        """Fields of the service's request, by name."""
        return Fields(self.arguments if isinstance(self.arguments, Mapping) else {}, self.given)

    def reply(self, values: object) -> None:
        """Answer with the fields of the response."""
        self._answer(values, done=True)

    def fail(self, why: str) -> None:
        """Answer that the call has failed."""
        self._answer(why, done=False)

    def _answer(self, values: object, *, done: bool) -> None:
        fields = {"op": "service_response", "id": self._id, "service": self.given, "values": values, "result": done}
        self._client.answer(fields, self.form)


def call_node(client: Peer, questions: Questions, call: Call, request: BridgeRequest) -> None:
    """Call a service of a node, and answer the client when the node has answered."""
    service = absolute_name(call.given)
    types = dict(client.host.session.node.get_service_names_and_types()).get(service, [])
    if not types:
        raise ConfigError(f"nobody offers a service {service}")
    named = full_name("srv", request.text_or("type", ""))
    type_name = named if named in types else types[0]
    message = find_interface("srv", type_name).Request()
    _fill_arguments(message, call.arguments)
    refuse_secrets(type_name, message)

    def reply(response: Any) -> None:
        call.reply(plain_values(response, call.form.compression))

    questions.ask(service, type_name, message, reply, call.fail, request.seconds_or("timeout", float("inf")))


def _fill_arguments(message: Any, arguments: object) -> None:
    """Set the fields of a request from a mapping, or from a list in their order."""
    if isinstance(arguments, list):
        names = list(message.get_fields_and_field_types())
        if len(arguments) > len(names):
            raise ConfigError(f"{len(arguments)} arguments are too many", expected=f"at most {len(names)}")
        arguments = dict(zip(names, arguments, strict=False))
    fill(message, {} if arguments is None else arguments)
