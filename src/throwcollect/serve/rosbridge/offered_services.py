"""A service that a client offers to nodes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest, Form

_numbers = itertools.count(1)


class OfferedService:
    """A service that a client offers, made from the client's names for it and for its type.

    Raises:
        ConfigError: If there is no such type, or ROS does not allow the name.
    """

    def __init__(self, client: Peer, given: str, type_name: str) -> None:
        self._client = client
        self._given = given
        self._name = absolute_name(given)
        self._type = find_interface("srv", type_name)
        self._pending: dict[str, tuple[ros.Future, Any]] = {}
        self._service: Any = None

    def open(self) -> None:
        """Offer it."""
        self._service = self._client.host.session.node.create_service(self._type, self._name, self._serve)

    def close(self) -> None:
        """Withdraw the service; nodes that wait for an answer get none."""
        if self._service is not None:
            self._client.host.session.node.destroy_service(self._service)
        # This ends callbacks that wait for the client. The service is withdrawn, so their answers are not sent.
        for future, response in self._pending.values():
            future.set_result(response)
        self.lose()

    def lose(self) -> None:
        """Forget the session, which has ended, and all requests that came by it."""
        self._service = None
        self._pending.clear()

    def respond(self, request: BridgeRequest) -> None:
        """Answer one request of a node as the client says."""
        if not isinstance(request.id, str) or request.id not in self._pending:
            raise ConfigError(f"service_response: no request {request.id} to {self._name} waits for an answer")
        future, response = self._pending[request.id]
        values = request.any("values")
        # With `result: false`, the values may be a text with the reason, instead of fields.
        if isinstance(values, Mapping) or request.flag("result", default=True):
            fill(response, {} if values is None else values)
        else:
            # ROS has no way to say that a service has failed, and without an answer the node would wait for ever.
            self._client.say("warning", f"{self._name}: a failed request is answered with defaults", request.id)
        # The request is removed last: if values of a wrong type raise an error above, the client can answer again.
        del self._pending[request.id]
        future.set_result(response)

    async def _serve(self, request: Any, response: Any) -> Any:
        number = f"service_request:{self._given}:{next(_numbers)}"
        future = ros.Future()
        self._pending[number] = future, response
        fields = {"op": "call_service", "id": number, "service": self._given, "args": plain_values(request)}
        self._client.answer(fields, Form())
        return await future
