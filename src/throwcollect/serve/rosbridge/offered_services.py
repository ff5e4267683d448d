"""Services that one client offers to nodes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.names import absolute_name, find_interface, full_name
from throwcollect.ros.values import fill
from throwcollect.serve.rosbridge.codec import json_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import Form, Request

_numbers = itertools.count(1)


class OfferedService:
    """A service that a client offers.

    Args:
        client: The client.
        given: Its name as the client has it.
        type_name: Full name of its type.

    Raises:
        ConfigError: If there is no such type, or its name is none.
    """

    def __init__(self, client: Peer, given: str, type_name: str) -> None:
        self._client = client
        self._given = given
        self._name = absolute_name(given)
        self._type = find_interface("srv", ros.get_service, type_name)
        self._pending: dict[str, tuple[ros.Future, Any]] = {}
        self._service: Any = None

    def open(self) -> None:
        """Offer it."""
        self._service = self._client.session.node.create_service(self._type, self._name, self._serve)

    def close(self) -> None:
        """Withdraw it; who waits for an answer gets none."""
        if self._service is not None:
            self._client.session.node.destroy_service(self._service)
        # What waits here may end; its answers reach nobody any more.
        for future, response in self._pending.values():
            future.set_result(response)
        self.lose()

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        self._service = None
        self._pending.clear()

    def respond(self, request: Request) -> None:
        """Take the answer of the client to one request of a node.

        Raises:
            ConfigError: If nobody has asked, or it is no answer of this type.
        """
        if not isinstance(request.id, str) or request.id not in self._pending:
            raise ConfigError(f"service_response: no request {request.id} to {self._name} waits for an answer")
        future, response = self._pending[request.id]
        values = request.any("values")
        if isinstance(values, Mapping) or request.flag("result", default=True):
            fill(response, {} if values is None else values)
        else:
            # ROS has no way to say that a service has failed, and without an answer the node would wait for ever.
            self._client.say("warning", f"{self._name}: a failed request is answered with defaults", request.id)
        del self._pending[request.id]
        future.set_result(response)

    async def _serve(self, request: Any, response: Any) -> Any:
        number = f"service_request:{self._given}:{next(_numbers)}"
        future = ros.Future()
        self._pending[number] = future, response
        fields = {"op": "call_service", "id": number, "service": self._given, "args": json_values(request)}
        self._client.answer(fields, Form())
        return await future


class OfferedServices:
    """All services that a client offers.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._by_name: dict[str, OfferedService] = {}

    def advertise(self, request: Request) -> None:
        """Offer a service, in place of one of this name that the client has offered before.

        Raises:
            ConfigError: If there is no such type, its name is none, or a node offers it already.
        """
        given = request.text("service")
        name = absolute_name(given)
        offered = OfferedService(self._client, given, full_name("srv", request.text("type")))
        if name in self._by_name:
            self._by_name.pop(name).close()
        elif self._client.session.is_offered_by_others(name):
            raise ConfigError(f"advertise_service: {name} is offered already", expected="another name")
        offered.open()
        self._by_name[name] = offered

    def unadvertise(self, request: Request) -> None:
        """Withdraw a service.

        Raises:
            ConfigError: If the client does not offer it.
        """
        self._find(request).close()
        del self._by_name[absolute_name(request.text("service"))]

    def respond(self, request: Request) -> None:
        """Take the answer of the client to one request of a node.

        Raises:
            ConfigError: If nobody has asked, or it is no answer.
        """
        self._find(request).respond(request)

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        for offered in self._by_name.values():
            offered.lose()

    def restore(self) -> None:
        """Offer everything again, in a new session."""
        for offered in self._by_name.values():
            offered.open()

    def close(self) -> None:
        """Withdraw everything."""
        for offered in self._by_name.values():
            offered.close()
        self._by_name.clear()

    def _find(self, request: Request) -> OfferedService:
        name = absolute_name(request.text("service"))
        if name not in self._by_name:
            raise ConfigError(f"{request.op}: {name} is not advertised by this client")
        return self._by_name[name]
