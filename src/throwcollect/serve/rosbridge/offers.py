"""Services or actions that one client offers to nodes, by their names."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any, Literal

from throwcollect import ros
from throwcollect.control import GoalStatus
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.belongings import ABelonging, Belongings
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest, Form

FAREWELL_S = 0.2
"""Time in which nodes get the last results of an action, before it is withdrawn."""
_numbers = itertools.count(1)


class OfferedAction:
    """An action that a client offers, made from the client's names for it and for its type.

    Raises:
        ConfigError: If there is no such type, or ROS does not allow the name.
    """

    def __init__(self, client: Peer, given: str, type_name: str) -> None:
        self._client = client
        self._given = given
        self._type_name = type_name
        self._name = absolute_name(given)
        self._type = find_interface("action", type_name)
        self._goals: dict[str, tuple[Any, ros.Future]] = {}
        self._server: ros.ActionServer | None = None

    def open(self) -> None:
        """Offer it."""
        self._server = ros.ActionServer(
            self._client.host.session.node, self._type, self._name, self._execute, cancel_callback=self._cancel
        )

    def close(self) -> None:
        """Withdraw the action; goals that are under way are aborted."""
        server, self._server = self._server, None
        if server is None:
            return
        if not self._goals:
            server.destroy()
            return
        for number in list(self._goals):
            self._finish(number, self._type.Result(), GoalStatus.ABORTED)
        # The action is withdrawn a bit later, so that nodes that wait for a result get it first.
        self._client.host.later(FAREWELL_S, server.destroy)

    def lose(self) -> None:
        """Forget the session, which has ended, and all goals that came by it."""
        self._server = None
        self._goals.clear()

    def publish_feedback(self, request: BridgeRequest) -> None:
        """Publish feedback of the client on a goal."""
        handle, _ = self._goals[self._find(request)]
        feedback = self._type.Feedback()
        fill(feedback, request.any("values"))
        handle.publish_feedback(feedback)

    def end(self, request: BridgeRequest) -> None:
        """End a goal with the client's result."""
        number = self._find(request)
        has_succeeded = request.flag("result", default=True)
        values, result = request.any("values"), self._type.Result()
        if isinstance(values, Mapping) or has_succeeded:
            fill(result, {} if values is None else values)
        status = request.natural_or("status", GoalStatus.SUCCEEDED) if has_succeeded else GoalStatus.ABORTED
        self._finish(number, result, status)

    def take_status(self, request: BridgeRequest) -> None:
        """Note the state of a goal; if it has ended, finish it with an empty result, as the client sends none."""
        number, status = self._find(request), request.natural_or("status", 0)
        if status in (GoalStatus.SUCCEEDED, GoalStatus.CANCELED, GoalStatus.ABORTED):
            self._finish(number, self._type.Result(), status)

    def _find(self, request: BridgeRequest) -> str:
        if not isinstance(request.id, str) or request.id not in self._goals:
            raise ConfigError(f"{request.op}: no goal {request.id} of {self._name} is under way")
        return request.id

    def _finish(self, number: str, result: Any, status: int) -> None:
        handle, future = self._goals.pop(number)
        if status == GoalStatus.SUCCEEDED:
            handle.succeed()
        # In ROS, a goal can be cancelled only after a request to cancel it; otherwise, this aborts it.
        elif status == GoalStatus.CANCELED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        future.set_result(result)

    async def _execute(self, handle: Any) -> Any:
        number = f"action_goal:{self._given}:{next(_numbers)}"
        future = ros.Future()
        self._goals[number] = handle, future
        fields = {
            "op": "send_action_goal",
            "id": number,
            "action": self._given,
            "action_type": self._type_name,
            "args": plain_values(handle.request),
            "feedback": True,
        }
        self._client.answer(fields, Form())
        return await future

    def _cancel(self, handle: Any) -> ros.CancelResponse:
        for number, (other, _) in self._goals.items():
            if other.goal_id == handle.goal_id:
                self._client.answer({"op": "cancel_action_goal", "id": number, "action": self._given}, Form())
        return ros.CancelResponse.ACCEPT


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


class Offers(Belongings[ABelonging]):
    """All services, or all actions, that a client offers.

    Args:
        client: The client.
        kind: The field of requests that has the name.
        make: Makes an offer from the client's name for it and the name of its type.
        probe: What is appended to an offer's name to get the name of a service that every node with that offer has.
    """

    def __init__(
        self,
        client: Peer,
        kind: Literal["service", "action"],
        make: Callable[[Peer, str, str], ABelonging],
        probe: str = "",
    ) -> None:
        super().__init__(client)
        self._kind = kind
        self._make = make
        self._probe = probe

    def advertise(self, request: BridgeRequest) -> None:
        """Offer a service or an action; it replaces an earlier offer of this client with the same name."""
        given = request.text(self._kind)
        name = absolute_name(given)
        # The new offer is made before the old one is withdrawn, so that a malformed request changes nothing.
        offered = self._make(self._client, given, request.text("type"))
        if name in self._by_name:
            self._withdraw(name)
        elif self._is_taken(name):
            raise ConfigError(f"{request.op}: {name} is offered already", expected="another name")
        offered.open()
        self._by_name[name] = offered
        self._client.host.offered.add(name + self._probe)

    def unadvertise(self, request: BridgeRequest) -> None:
        """Withdraw something."""
        self._find(request)
        self._withdraw(absolute_name(request.text(self._kind)))

    def close(self) -> None:
        """Withdraw everything."""
        for name in list(self._by_name):
            self._withdraw(name)

    def pass_on(self, operation: Callable[[ABelonging, BridgeRequest], None]) -> Callable[[BridgeRequest], None]:
        """Make a function that passes a request of the client to the offer that the request names."""
        return lambda request: operation(self._find(request), request)

    def _withdraw(self, name: str) -> None:
        self._client.host.offered.discard(name + self._probe)
        self._by_name.pop(name).close()

    def _is_taken(self, name: str) -> bool:
        # All clients offer through the one node of the bridge, so the graph does not tell their offers apart.
        service = name + self._probe
        return service in self._client.host.offered or self._client.host.session.is_offered_by_others(service)

    def _find(self, request: BridgeRequest) -> ABelonging:
        name = absolute_name(request.text(self._kind))
        if name not in self._by_name:
            raise ConfigError(f"{request.op}: {name} is not advertised by this client")
        return self._by_name[name]
