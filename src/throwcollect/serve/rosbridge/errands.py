"""Requests of one client to services and actions of nodes, each until it is answered or cannot be answered."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import BridgeRequest, Form, RequestId

_UNKNOWN = 0
"""Of action_msgs/msg/GoalStatus."""


READY_S = 5.0
"""Time in which nodes find each other."""
_POLL_S = 0.02
_WATCH_S = 1.0


class Errand:
    """One request of a client to a node; it ends once.

    Attributes:
        name: Absolute name of the service or action.
        fail: Tells the client why there is no answer.
        is_open: Whether the errand has not ended yet.
    """

    def __init__(self, name: str, fail: Callable[[str], None]) -> None:
        self.name = name
        self.fail = fail
        self.is_open = True


AnErrand = TypeVar("AnErrand", bound=Errand)


class Errands(Generic[AnErrand]):
    """All errands of one kind that a client waits for.

    Args:
        client: The client.
        unoffered: Sentence, with a place for the name, that says that no node offers the service or action.
        gone: Sentence, with a place for the name, that says that the node has ended before it answered.
    """

    def __init__(self, client: Peer, unoffered: str, gone: str) -> None:
        self._client = client
        self._unoffered = unoffered
        self._gone = gone
        self._open: list[AnErrand] = []

    def begin(
        self, errand: AnErrand, is_ready: Callable[[], bool], send: Callable[[], object], patience_s: float = READY_S
    ) -> None:
        """Send a request as soon as the node is found, and check from then on whether the node still exists.

        Args:
            errand: The request.
            is_ready: Returns whether a node offers the service or action.
            send: Sends the request; may raise `TypeError` or `ValueError` if the request is malformed.
            patience_s: Time within which the node has to be found [s].
        """
        self._open.append(errand)
        self._send_when_ready(errand, is_ready, send, time.monotonic() + patience_s)

    def end(self, errand: AnErrand) -> bool:
        """Take an errand off the list; returns whether it was still open."""
        was_open, errand.is_open = errand.is_open, False
        if was_open:
            self._open.remove(errand)
        return was_open

    def fail(self, errand: AnErrand, why: str) -> None:
        """End an errand without an answer, unless it has ended already."""
        if self.end(errand):
            errand.fail(why)

    def lose(self) -> None:
        """Fail all errands, because the session has ended."""
        for errand in list(self._open):
            self.fail(errand, f"{errand.name}: the router of the run has gone")

    def restore(self) -> None:
        """Do nothing in a new session: `lose` has told the client that its requests failed."""

    def close(self) -> None:
        """Stop waiting for answers; nodes go on with what they have begun."""
        for errand in list(self._open):
            self.end(errand)

    def _send_when_ready(
        self, errand: AnErrand, is_ready: Callable[[], bool], send: Callable[[], object], deadline: float
    ) -> None:
        if not errand.is_open:
            return
        if is_ready():
            try:
                send()
            except (TypeError, ValueError) as error:
                self.fail(errand, f"{errand.name}: {error}")
            self._watch(errand, is_ready)
        elif time.monotonic() < deadline:
            self._client.host.later(_POLL_S, partial(self._send_when_ready, errand, is_ready, send, deadline))
        else:
            self.fail(errand, self._unoffered.format(errand.name))

    def _watch(self, errand: AnErrand, is_ready: Callable[[], bool]) -> None:
        """Fail an errand whose service or action has gone."""
        if not errand.is_open:
            return
        if is_ready():
            self._client.host.later(_WATCH_S, partial(self._watch, errand, is_ready))
        else:
            self.fail(errand, self._gone.format(errand.name))


class Questions(Errands[Errand]):
    """All requests of one client to services that wait for an answer."""

    def __init__(self, client: Peer) -> None:
        super().__init__(client, "{}: nobody offers the service", "{}: the service has gone without an answer")

    def ask(
        self,
        service: str,
        type_name: str,
        message: Any,
        answered: Callable[[Any], None],
        failed: Callable[[str], None],
        timeout_s: float = float("inf"),
    ) -> None:
        """Call a service.

        Args:
            service: Its absolute name.
            type_name: Full name of its type.
            message: The request.
            answered: Called with the response.
            failed: Called with a sentence if there will be none.
            timeout_s: Time after which the call fails [s].
        """
        client = self._client.host.session.service_client(service, type_name)
        question = Errand(service, failed)

        def finish(future: Any) -> None:
            if self.end(question):
                answered(future.result())

        def send() -> None:
            client.call_async(message).add_done_callback(finish)

        self.begin(question, client.service_is_ready, send, min(READY_S, timeout_s))
        if timeout_s < float("inf"):
            late = f"{service}: no answer within {timeout_s:g} s"
            self._client.host.later(timeout_s, partial(self.fail, question, late))


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
