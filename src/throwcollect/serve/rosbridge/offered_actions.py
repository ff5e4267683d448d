"""An action that a client offers to nodes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from throwcollect import ros
from throwcollect.control import GoalStatus
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.ros.message_values import fill
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
