"""Services and actions that one client offers to nodes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any, Literal

from throwcollect import ros
from throwcollect.control.values import GoalStatus
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import Kind, absolute_name, find_interface
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.bridge import FAREWELL_S, Client
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.operations import Answer, Offer

_numbers = itertools.count(1)


class AdvertisedService:
    """A service that a client offers."""

    def __init__(self, client: Client, asked: Offer) -> None:
        self._client = client
        self._given = asked.name
        self._pending: dict[object, tuple[ros.Future, Any]] = {}
        self._service = client.bridge.node.create_service(
            find_interface("srv", asked.type), absolute_name(asked.name), self._serve
        )

    def close(self) -> None:
        """Withdraw the service; nodes that wait for an answer get none."""
        self._client.bridge.node.destroy_service(self._service)
        # This ends callbacks that wait for the client. The service is withdrawn, so their answers are not sent.
        for future, response in self._pending.values():
            future.set_result(response)

    def take(self, answer: Answer) -> None:
        """Answer one request of a node with the client's response."""
        if answer.id not in self._pending:
            raise ConfigError(f"service_response: no request {answer.id} to {answer.name} waits for an answer")
        future, response = self._pending[answer.id]
        # With `result: false`, the values may be a string with the reason, instead of fields.
        # ROS cannot report to a node that a service has failed, so such a request is answered with defaults.
        if isinstance(answer.values, Mapping) or answer.result:
            fill(response, {} if answer.values is None else answer.values)
        # The request is removed last: if values of a wrong type raise an error above, the client can answer again.
        del self._pending[answer.id]
        future.set_result(response)

    async def _serve(self, request: Any, response: Any) -> Any:
        number = f"service_request:{self._given}:{next(_numbers)}"
        future = ros.Future()
        self._pending[number] = future, response
        self._client.answer({"op": "call_service", "id": number, "service": self._given, "args": plain_values(request)})
        return await future


class AdvertisedAction:
    """An action that a client offers."""

    def __init__(self, client: Client, asked: Offer) -> None:
        self._client = client
        self._asked = asked
        self._type = find_interface("action", asked.type)
        self._goals: dict[object, tuple[Any, ros.Future]] = {}
        self._server = ros.ActionServer(
            client.bridge.node, self._type, absolute_name(asked.name), self._execute, cancel_callback=self._cancel
        )

    def close(self) -> None:
        """Withdraw the action; goals that are under way are aborted."""
        if not self._goals:
            self._server.destroy()
            return
        for number in list(self._goals):
            self._finish(number, self._type.Result(), GoalStatus.ABORTED)
        # The action is withdrawn a bit later, so that nodes that wait for a result get it first.
        self._client.bridge.later(FAREWELL_S, self._server.destroy)

    def take(self, answer: Answer) -> None:
        """Take the client's feedback on a goal, its result, or its state, which ends the goal without a result."""
        if answer.id not in self._goals:
            raise ConfigError(f"{answer.op}: no goal {answer.id} of {answer.name} is under way")
        values = {} if answer.values is None else answer.values
        if answer.op == "action_feedback":
            feedback = self._type.Feedback()
            fill(feedback, values)
            self._goals[answer.id][0].publish_feedback(feedback)
        elif answer.op == "action_result":
            result = self._type.Result()
            if isinstance(values, Mapping) or answer.result:
                fill(result, values)
            status = GoalStatus.SUCCEEDED if answer.status is None else answer.status
            self._finish(answer.id, result, status if answer.result else GoalStatus.ABORTED)
        elif answer.status in (GoalStatus.SUCCEEDED, GoalStatus.CANCELED, GoalStatus.ABORTED):
            self._finish(answer.id, self._type.Result(), answer.status)

    def _finish(self, number: object, result: Any, status: int) -> None:
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
        number = f"action_goal:{self._asked.name}:{next(_numbers)}"
        future = ros.Future()
        self._goals[number] = handle, future
        fields = {
            "op": "send_action_goal",
            "id": number,
            "action": self._asked.name,
            "action_type": self._asked.type,
            "args": plain_values(handle.request),
            "feedback": True,
        }
        self._client.answer(fields)
        return await future

    def _cancel(self, handle: Any) -> ros.CancelResponse:
        for number, (other, _) in self._goals.items():
            if other.goal_id == handle.goal_id:
                self._client.answer({"op": "cancel_action_goal", "id": number, "action": self._asked.name})
        return ros.CancelResponse.ACCEPT


class Advertised:
    """All services, or all actions, that a client offers.

    Args:
        client: The client.
        kind: Which of the two.
    """

    def __init__(self, client: Client, kind: Literal["srv", "action"]) -> None:
        self._client = client
        self._kind: Kind = kind
        self._make = AdvertisedService if kind == "srv" else AdvertisedAction
        self._by_name: dict[str, AdvertisedService | AdvertisedAction] = {}

    def advertise(self, asked: Offer) -> None:
        """Offer a service or an action; it replaces an earlier one of this client with the same name."""
        # A request with an unknown type must not withdraw the earlier one.
        find_interface(self._kind, asked.type)
        self.unadvertise(asked)
        self._by_name[absolute_name(asked.name)] = self._make(self._client, asked)

    def unadvertise(self, asked: Offer) -> None:
        """Withdraw a service or an action."""
        if (offered := self._by_name.pop(absolute_name(asked.name), None)) is not None:
            offered.close()

    def take(self, answer: Answer) -> None:
        """Take what the client answers to a node."""
        offered = self._by_name.get(absolute_name(answer.name))
        if offered is None:
            raise ConfigError(f"{answer.op}: {answer.name} is not advertised by this client")
        offered.take(answer)

    def close(self) -> None:
        """Withdraw everything."""
        for offered in self._by_name.values():
            offered.close()
