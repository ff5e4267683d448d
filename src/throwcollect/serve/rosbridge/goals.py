"""Goals that one client sends to actions of nodes."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.names import absolute_name, find_interface
from throwcollect.ros.values import fill
from throwcollect.serve.rosbridge.codec import cbor_values, json_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.questions import POLL_S, READY_S, WATCH_S
from throwcollect.serve.rosbridge.request import Form, Request, RequestId

_UNKNOWN = 0
"""Of action_msgs/msg/GoalStatus."""


class Goal:
    """One goal of a client, which gets one result.

    Args:
        client: The client.
        request: What it asks.

    Attributes:
        action: Absolute name of the action.
        handle: The goal in ROS, once it is accepted.
        is_cancelled: Whether the client has asked to cancel it.

        is_open: Whether it has no result yet.

    Raises:
        ConfigError: If the request does not say for which action.
    """

    def __init__(self, client: Peer, request: Request) -> None:
        self._client = client
        self.id: RequestId = request.id
        self._given = request.text("action")
        self.action = absolute_name(self._given)
        self._form = Form()
        self._wants_feedback = False
        self.handle: Any = None
        self.is_cancelled = False
        self.is_open = True

    def agree(self, request: Request) -> None:
        """Take note of what the client wants to hear of the goal.

        Raises:
            ConfigError: If that cannot be.
        """
        self._form = request.form()
        self._wants_feedback = request.flag("feedback")

    @property
    def on_feedback(self) -> Any:
        """What takes messages of feedback; None if the client wants none."""
        return self._tell if self._wants_feedback else None

    def end(self, result: Any, status: int) -> None:
        """Tell the client of the result."""
        self._answer("action_result", self._values(result), status=status, result=True)

    def fail(self, why: str) -> None:
        """Tell the client that there is no result."""
        self._answer("action_result", why, status=_UNKNOWN, result=False)

    def _tell(self, message: Any) -> None:
        if self.is_open:
            self._answer("action_feedback", self._values(message.feedback))

    def _values(self, message: Any) -> Any:
        return json_values(message) if self._form.compression == "none" else cbor_values(message)

    def _answer(self, op: str, values: Any, **more: object) -> None:
        fields = {"op": op, "id": self.id, "action": self._given, "values": values, **more}
        self._client.answer(fields, self._form)


class Goals:
    """All goals that a client has sent and that have not ended.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._open: list[Goal] = []
        self._clients: dict[tuple[str, str], ros.ActionClient] = {}

    def send(self, goal: Goal, request: Request) -> None:
        """Send a goal.

        Args:
            goal: The goal.
            request: What the client asks.

        Raises:
            ConfigError: If nobody offers the action, or it cannot have such a goal.
        """
        goal.agree(request)
        there = dict(ros.get_action_names_and_types(self._client.session.node)).get(goal.action, [])
        action_type = find_interface("action", ros.get_action, request.text("action_type"))
        if not there:
            raise ConfigError(f"nobody offers an action {goal.action}")
        message = action_type.Goal()
        values = request.any("args")
        fill(message, {} if values is None or values == [] else values)
        if goal.id is not None and any(other.id == goal.id for other in self._open):
            raise ConfigError(f"send_action_goal: a goal with the id {goal.id} is under way already")
        key = goal.action, request.text("action_type")
        if key not in self._clients:
            self._clients[key] = ros.ActionClient(self._client.session.node, action_type, goal.action)
        self._open.append(goal)
        self._send_when_ready(goal, self._clients[key], message, time.monotonic() + READY_S)

    def cancel(self, request: Request) -> None:
        """Ask for a goal to be cancelled; its result tells what came of that.

        Raises:
            ConfigError: If there is no such goal.
        """
        goal = next((goal for goal in self._open if goal.id == request.id), None)
        if goal is None or goal.id is None:
            raise ConfigError(f"cancel_action_goal: no goal with the id {request.id} is under way")
        goal.is_cancelled = True
        if goal.handle is not None:
            goal.handle.cancel_goal_async()

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        self._clients.clear()
        for goal in list(self._open):
            self._fail(goal, f"{goal.action}: the router of the run has gone")

    def restore(self) -> None:
        """Have everything again: goals are not sent anew."""

    def close(self) -> None:
        """Hear of no goal any more; those that are under way go on."""
        for goal in self._open:
            goal.is_open = False
        self._open.clear()
        for client in self._clients.values():
            client.destroy()
        self._clients.clear()

    def _send_when_ready(self, goal: Goal, client: ros.ActionClient, message: Any, deadline: float) -> None:
        if not goal.is_open:
            return
        if client.server_is_ready():
            try:
                sent = client.send_goal_async(message, feedback_callback=goal.on_feedback)
                sent.add_done_callback(partial(self._take_answer, goal))
            except (TypeError, ValueError) as error:
                self._fail(goal, f"{goal.action}: {error}")
            self._watch(goal, client)
        elif time.monotonic() < deadline:
            self._client.later(POLL_S, partial(self._send_when_ready, goal, client, message, deadline))
        else:
            self._fail(goal, f"nobody offers {goal.action} with this type")

    def _watch(self, goal: Goal, client: ros.ActionClient) -> None:
        """Give a goal up whose action has gone."""
        if not goal.is_open:
            return
        if client.server_is_ready():
            self._client.later(WATCH_S, partial(self._watch, goal, client))
        else:
            self._fail(goal, f"{goal.action}: the action has gone, and no result has come")

    def _take_answer(self, goal: Goal, future: Any) -> None:
        handle = future.result()
        if not goal.is_open:
            return
        if not handle.accepted:
            self._fail(goal, f"{goal.action}: the goal was rejected")
            return
        goal.handle = handle
        handle.get_result_async().add_done_callback(partial(self._take_result, goal))
        if goal.is_cancelled:
            handle.cancel_goal_async()

    def _take_result(self, goal: Goal, future: Any) -> None:
        if goal.is_open:
            self._close(goal)
            goal.end(future.result().result, int(future.result().status))

    def _fail(self, goal: Goal, why: str) -> None:
        self._close(goal)
        goal.fail(why)

    def _close(self, goal: Goal) -> None:
        goal.is_open = False
        self._open.remove(goal)
