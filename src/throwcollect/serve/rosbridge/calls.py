"""Calls of services by a client: how they are answered, and how those of nodes are called."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface, full_name
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.client import Client
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.guarded import refuse_secrets
from throwcollect.serve.rosbridge.operations import CallService, read_fields
from throwcollect.serve.rosbridge.pending import call_service


class Arguments(BaseModel):
    """Arguments of the services that the bridge answers; each service has some of them."""

    type: str = ""
    topic: str = ""
    service: str = ""
    node: str = ""
    name: str = ""
    value: str = ""
    default_value: str = ""


class Call:
    """One call of a client, which is answered once.

    Attributes:
        client: The client.
        asked: What it has sent.
    """

    def __init__(self, client: Client, asked: CallService) -> None:
        self.client = client
        self.asked = asked

    @property
    def arguments(self) -> Arguments:
        """Arguments for the bridge."""
        given = self.asked.args if isinstance(self.asked.args, Mapping) else {}
        given = {name: value for name, value in given.items() if value is not None}
        return read_fields(Arguments.model_validate, given, f"{self.asked.name}: ")

    def reply(self, values: object) -> None:
        """Answer with the fields of the response."""
        fields = {"op": "service_response", "id": self.asked.id, "service": self.asked.name}
        self.client.answer({**fields, "values": values, "result": True}, self.asked)

    def fail(self, reason: object) -> None:
        """Answer that the call has failed."""
        self.client.fail(self.asked, reason)


def call_node(call: Call) -> None:
    """Call a service of a node, and answer the client when the node has answered."""
    client, service, arguments = call.client, absolute_name(call.asked.name), call.asked.args
    types = dict(client.bridge.node.get_service_names_and_types()).get(service, [])
    if not types:
        raise ConfigError(f"nobody offers a service {service}")
    named = full_name("srv", call.asked.type)
    type_name = named if named in types else types[0]
    message = find_interface("srv", type_name).Request()
    if isinstance(arguments, list):
        names = list(message.get_fields_and_field_types())
        if len(arguments) > len(names):
            raise ConfigError(f"{len(arguments)} arguments are too many", expected=f"at most {len(names)}")
        arguments = dict(zip(names, arguments, strict=False))
    fill(message, {} if arguments is None else arguments)
    refuse_secrets(type_name, message)

    def reply(response: Any) -> None:
        call.reply(plain_values(response, call.asked.compression))

    call_service(client, service, type_name, message, reply, call.fail, call.asked.timeout)
