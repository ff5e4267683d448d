"""Goals that one client sends to actions of nodes."""

from __future__ import annotations

from functools import partial
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.errands import Errand, Errands
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest, Form, RequestId

_UNKNOWN = 0
"""Of action_msgs/msg/GoalStatus."""


class Goal(Errand):
    """One goal of a client, which gets one result.

    Attributes:
        id: The client's name for the goal.
        form: How feedback and result are sent to the client.
        handle: The goal in ROS, once the action has accepted it.
        is_cancelled: Whether the client has asked to cancel it.

    Raises:
        ConfigError: If the request names no action.
    """

    def __init__(self, client: Peer, request: BridgeRequest) -> None:
        self._client = client
        self.id: RequestId = request.id
        self._given = request.text("action")
        super().__init__(absolute_name(self._given), self._send_failure)
        self.form = Form()
        self.handle: Any = None
        self.is_cancelled = False

    def send_feedback(self, message: Any) -> None:
        """Send feedback to the client; feedback after the result is dropped."""
        if self.is_open:
            self._answer("action_feedback", plain_values(message.feedback, self.form.compression))

    def succeed(self, result: Any, status: int) -> None:
        """Send the result to the client."""
        self._answer("action_result", plain_values(result, self.form.compression), status=status, result=True)

    def _send_failure(self, why: str) -> None:
        self._answer("action_result", why, status=_UNKNOWN, result=False)

    def _answer(self, op: str, values: Any, **more: object) -> None:
        fields = {"op": op, "id": self.id, "action": self._given, "values": values, **more}
        self._client.answer(fields, self.form)


class Goals(Errands[Goal]):
    """All goals that a client has sent and that have not ended."""

    def __init__(self, client: Peer) -> None:
        super().__init__(client, "nobody offers {} with this type", "{}: the action has gone without a result")
        self._action_clients: dict[tuple[str, str], ros.ActionClient] = {}

    def send(self, goal: Goal, request: BridgeRequest) -> None:
        """Send a goal."""
        goal.form = request.form()
        on_feedback = goal.send_feedback if request.flag("feedback") else None
        type_name = request.text("action_type")
        action_type = find_interface("action", type_name)
        if goal.name not in dict(ros.get_action_names_and_types(self._client.host.session.node)):
            raise ConfigError(f"nobody offers an action {goal.name}")
        message = action_type.Goal()
        values = request.any("args")
        fill(message, {} if values is None or values == [] else values)
        if goal.id is not None and any(other.id == goal.id for other in self._open):
            raise ConfigError(f"send_action_goal: a goal with the id {goal.id} is under way already")
        key = goal.name, type_name
        if key not in self._action_clients:
            self._action_clients[key] = ros.ActionClient(self._client.host.session.node, action_type, goal.name)
        client = self._action_clients[key]

        def send() -> None:
            client.send_goal_async(message, feedback_callback=on_feedback).add_done_callback(
                partial(self._take_answer, goal)
            )

        self.begin(goal, client.server_is_ready, send)

    def cancel(self, request: BridgeRequest) -> None:
        """Ask the action to cancel a goal; the goal's result says whether it did."""
        goal = next((goal for goal in self._open if goal.id == request.id), None)
        if goal is None or goal.id is None:
            raise ConfigError(f"cancel_action_goal: no goal with the id {request.id} is under way")
        goal.is_cancelled = True
        if goal.handle is not None:
            goal.handle.cancel_goal_async()

    def lose(self) -> None:
        """Fail all goals, because the session has ended."""
        self._action_clients.clear()
        super().lose()

    def close(self) -> None:
        """Stop waiting for results; goals that are under way go on."""
        super().close()
        for client in self._action_clients.values():
            client.destroy()
        self._action_clients.clear()

    def _take_answer(self, goal: Goal, future: Any) -> None:
        handle = future.result()
        if not goal.is_open:
            return
        if not handle.accepted:
            self.fail(goal, f"{goal.name}: the goal was rejected, and /rosout has the reason (docs/rosbridge.md)")
            return
        goal.handle = handle
        handle.get_result_async().add_done_callback(partial(self._take_result, goal))
        # If the client asked to cancel the goal before the action accepted it, it is cancelled now.
        if goal.is_cancelled:
            handle.cancel_goal_async()

    def _take_result(self, goal: Goal, future: Any) -> None:
        if self.end(goal):
            goal.succeed(future.result().result, int(future.result().status))
