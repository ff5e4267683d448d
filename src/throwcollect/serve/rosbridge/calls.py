"""Calls and goals that a client sends to nodes or to the bridge, each until it is answered or cannot be answered."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from pydantic import BaseModel

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface, full_name
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.client import Client, refuse_secrets
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.operations import CallService, CancelGoal, SendGoal, read_fields

_READY_S = 5.0
"""Time in which nodes find each other."""
_POLL_S = 0.02
_WATCH_S = 1.0


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
        raise ConfigError(f"no node offers a service {service}")
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


class PendingCall:
    """A request of a client to a node, which ends once: with an answer, or with the reason why there is none.

    Args:
        client: The client.
        name: Absolute name of the service or action.
        fail: Called with the reason.

    Attributes:
        is_open: Whether it has not ended yet.
    """

    def __init__(self, client: Client, name: str, fail: Callable[[str], None]) -> None:
        self.is_open = True
        self._client = client
        self._name = name
        self._fail = fail

    def begin(self, is_ready: Callable[[], bool], send: Callable[[], object], patience_s: float = _READY_S) -> None:
        """Send the request as soon as a node is found that offers the service or action, or fail after a time [s]."""
        self._send_when_ready(is_ready, send, time.monotonic() + patience_s)

    def end(self) -> bool:
        """End it; returns whether it was still open."""
        was_open, self.is_open = self.is_open, False
        return was_open

    def give_up(self, reason: str) -> None:
        """End it without an answer, unless it has ended already."""
        if self.end():
            self._fail(f"{self._name}: {reason}")

    def _send_when_ready(self, is_ready: Callable[[], bool], send: Callable[[], object], deadline: float) -> None:
        if not self.is_open or self._client.is_closed:
            return
        if is_ready():
            try:
                send()
            except (TypeError, ValueError) as error:
                self.give_up(str(error))
            self._watch(is_ready)
        elif time.monotonic() < deadline:
            self._client.bridge.later(_POLL_S, partial(self._send_when_ready, is_ready, send, deadline))
        else:
            self.give_up("no node offers it with this type")

    def _watch(self, is_ready: Callable[[], bool]) -> None:
        if not is_ready():
            self.give_up("it has gone without an answer")
        elif self.is_open and not self._client.is_closed:
            self._client.bridge.later(_WATCH_S, partial(self._watch, is_ready))


def call_service(
    client: Client,
    service: str,
    type_name: str,
    request: Any,
    answered: Callable[[Any], None],
    fail: Callable[[str], None],
    timeout_s: float = math.inf,
) -> None:
    """Call a service of a node.

    Args:
        client: The client that asks for it.
        service: Absolute name of the service.
        type_name: Full name of its type.
        request: The request.
        answered: Called with the response.
        fail: Called with the reason why there is none.
        timeout_s: Time after which the call fails [s].
    """
    caller = client.bridge.service_client(service, type_name)
    pending = PendingCall(client, service, fail)

    def finish(future: Any) -> None:
        if pending.end():
            answered(future.result())

    pending.begin(
        caller.service_is_ready,
        lambda: caller.call_async(request).add_done_callback(finish),
        min(_READY_S, timeout_s),
    )
    if timeout_s < math.inf:
        client.bridge.later(timeout_s, partial(pending.give_up, f"no answer within {timeout_s:g} s"))


class _Goal(PendingCall):
    """One goal, which gets one result; ``handle`` is the goal in ROS, once the action has accepted it."""

    def __init__(self, client: Client, asked: SendGoal) -> None:
        super().__init__(client, absolute_name(asked.name), partial(client.fail, asked))
        self.asked = asked
        self.handle: Any = None
        self.is_cancelled = False

    def send_feedback(self, message: Any) -> None:
        """Send feedback to the client; feedback after the result is dropped."""
        if self.is_open:
            self._answer("action_feedback", message.feedback)

    def take_answer(self, future: Any) -> None:
        """Take the answer of the action, which accepts or rejects the goal."""
        self.handle = handle = future.result()
        if not handle.accepted:
            self.give_up("the goal was rejected, and /rosout has the reason (docs/ros.md)")
        elif self.is_open:
            handle.get_result_async().add_done_callback(self._take_result)
            # If the client asked to cancel the goal before the action accepted it, it is cancelled now.
            if self.is_cancelled:
                handle.cancel_goal_async()

    def cancel(self) -> None:
        """Ask the action to cancel the goal; the result has its answer."""
        self.is_cancelled = True
        if self.handle is not None:
            self.handle.cancel_goal_async()

    def _take_result(self, future: Any) -> None:
        if self.end():
            self._answer("action_result", future.result().result, status=int(future.result().status), result=True)

    def _answer(self, op: str, message: Any, **more: object) -> None:
        values = plain_values(message, self.asked.compression)
        fields = {"op": op, "id": self.asked.id, "action": self.asked.name, "values": values, **more}
        self._client.answer(fields, self.asked)


class Goals:
    """All goals that a client has sent and that have not ended."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._goals: list[_Goal] = []
        self._action_clients: dict[tuple[str, str], ros.ActionClient] = {}

    def send(self, asked: SendGoal) -> None:
        """Send a goal."""
        goal = _Goal(self._client, asked)
        name, node = absolute_name(asked.name), self._client.bridge.node
        action_type = find_interface("action", asked.action_type)
        if name not in dict(ros.get_action_names_and_types(node)):
            raise ConfigError(f"no node offers an action {name}")
        message = action_type.Goal()
        fill(message, {} if asked.args is None or asked.args == [] else asked.args)
        self._goals = [each for each in self._goals if each.is_open]
        if asked.id is not None and any(each.asked.id == asked.id for each in self._goals):
            raise ConfigError(f"send_action_goal: a goal with the id {asked.id} is under way already")
        self._goals.append(goal)
        key = name, asked.action_type
        if key not in self._action_clients:
            self._action_clients[key] = ros.ActionClient(node, action_type, name)
        client = self._action_clients[key]
        hear = goal.send_feedback if asked.feedback else None
        goal.begin(
            client.server_is_ready,
            lambda: client.send_goal_async(message, feedback_callback=hear).add_done_callback(goal.take_answer),
        )

    def cancel(self, asked: CancelGoal) -> None:
        """Ask the action to cancel a goal."""
        goal = next((each for each in self._goals if each.is_open and each.asked.id == asked.id), None)
        if goal is None or asked.id is None:
            raise ConfigError(f"cancel_action_goal: no goal with the id {asked.id} is under way")
        goal.cancel()

    def close(self) -> None:
        """Stop waiting for results; goals that are under way go on."""
        for client in self._action_clients.values():
            client.destroy()
