"""Actions that one client offers to nodes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.names import absolute_name, find_interface
from throwcollect.ros.values import fill
from throwcollect.serve.rosbridge.codec import json_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import Form, Request

_SUCCEEDED, _CANCELED, _ABORTED = 4, 5, 6
"""Of action_msgs/msg/GoalStatus."""
_FAREWELL_S = 0.2
_numbers = itertools.count(1)


class OfferedAction:
    """An action that a client offers.

    Args:
        client: The client.
        given: Its name as the client has it.
        type_name: Name of its type.

    Raises:
        ConfigError: If there is no such type, or its name is none.
    """

    def __init__(self, client: Peer, given: str, type_name: str) -> None:
        self._client = client
        self._given = given
        self._type_name = type_name
        self._name = absolute_name(given)
        self._type = find_interface("action", ros.get_action, type_name)
        self._goals: dict[str, tuple[Any, ros.Future]] = {}
        self._server: ros.ActionServer | None = None

    def open(self) -> None:
        """Offer it."""
        self._server = ros.ActionServer(
            self._client.session.node, self._type, self._name, self._execute, cancel_callback=self._cancel
        )

    def close(self) -> None:
        """Withdraw it; goals that are under way are aborted."""
        server, self._server = self._server, None
        if server is None:
            return
        if not self._goals:
            server.destroy()
            return
        for number in list(self._goals):
            self._finish(number, self._type.Result(), _ABORTED)
        # Once those who wait for a result have got it.
        self._client.later(_FAREWELL_S, server.destroy)

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        self._server = None
        self._goals.clear()

    def tell(self, request: Request) -> None:
        """Publish how far a goal has come, as the client says it.

        Raises:
            ConfigError: If there is no such goal, or it is no feedback of this type.
        """
        handle, _ = self._goals[self._find(request)]
        feedback = self._type.Feedback()
        fill(feedback, request.any("values"))
        handle.publish_feedback(feedback)

    def end(self, request: Request) -> None:
        """End a goal with the result that the client has.

        Raises:
            ConfigError: If there is no such goal, or it is no result of this type.
        """
        number = self._find(request)
        has_succeeded = request.flag("result", default=True)
        values, result = request.any("values"), self._type.Result()
        if isinstance(values, Mapping) or has_succeeded:
            fill(result, {} if values is None else values)
        self._finish(number, result, request.natural_or("status", _SUCCEEDED) if has_succeeded else _ABORTED)

    def settle(self, request: Request) -> None:
        """Take note of the state of a goal; one that has ended without a result gets an empty one.

        Raises:
            ConfigError: If there is no such goal.
        """
        number, status = self._find(request), request.natural_or("status", 0)
        if status in (_SUCCEEDED, _CANCELED, _ABORTED):
            self._finish(number, self._type.Result(), status)

    def _find(self, request: Request) -> str:
        if not isinstance(request.id, str) or request.id not in self._goals:
            raise ConfigError(f"{request.op}: no goal {request.id} of {self._name} is under way")
        return request.id

    def _finish(self, number: str, result: Any, status: int) -> None:
        handle, future = self._goals.pop(number)
        if status == _SUCCEEDED:
            handle.succeed()
        elif status == _CANCELED and handle.is_cancel_requested:
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
            "args": json_values(handle.request),
            "feedback": True,
        }
        self._client.answer(fields, Form())
        return await future

    def _cancel(self, handle: Any) -> ros.CancelResponse:
        for number, (other, _) in self._goals.items():
            if other.goal_id == handle.goal_id:
                self._client.answer({"op": "cancel_action_goal", "id": number, "action": self._given}, Form())
        return ros.CancelResponse.ACCEPT


class OfferedActions:
    """All actions that a client offers.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._by_name: dict[str, OfferedAction] = {}

    def advertise(self, request: Request) -> None:
        """Offer an action, in place of one of this name that the client has offered before.

        Raises:
            ConfigError: If there is no such type, its name is none, or a node offers it already.
        """
        given = request.text("action")
        name = absolute_name(given)
        offered = OfferedAction(self._client, given, request.text("type"))
        if name in self._by_name:
            self._by_name.pop(name).close()
        elif self._client.session.is_offered_by_others(f"{name}/_action/send_goal"):
            raise ConfigError(f"advertise_action: {name} is offered already", expected="another name")
        offered.open()
        self._by_name[name] = offered

    def unadvertise(self, request: Request) -> None:
        """Withdraw an action.

        Raises:
            ConfigError: If the client does not offer it.
        """
        self._find(request).close()
        del self._by_name[absolute_name(request.text("action"))]

    def tell(self, request: Request) -> None:
        """Publish how far a goal has come.

        Raises:
            ConfigError: If there is no such goal, or it is no feedback of this type.
        """
        self._find(request).tell(request)

    def end(self, request: Request) -> None:
        """End a goal with its result.

        Raises:
            ConfigError: If there is no such goal, or it is no result of this type.
        """
        self._find(request).end(request)

    def settle(self, request: Request) -> None:
        """Take note of the state of a goal.

        Raises:
            ConfigError: If there is no such goal.
        """
        self._find(request).settle(request)

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

    def _find(self, request: Request) -> OfferedAction:
        name = absolute_name(request.text("action"))
        if name not in self._by_name:
            raise ConfigError(f"{request.op}: {name} is not advertised by this client")
        return self._by_name[name]
