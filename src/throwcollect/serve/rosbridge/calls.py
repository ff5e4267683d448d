"""Calls and goals that a client sends to nodes, each until it is answered or cannot be answered."""

from __future__ import annotations

import math
import time
import types
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

from throwcollect import ros
from throwcollect.errors import ConfigError
from throwcollect.ros.graph_names import absolute_name, find_interface, full_name
from throwcollect.ros.message_values import fill
from throwcollect.serve.rosbridge.bridge import Client
from throwcollect.serve.rosbridge.codec import plain_values
from throwcollect.serve.rosbridge.guarded import refuse_secrets
from throwcollect.serve.rosbridge.operations import CallService, CancelGoal, SendGoal

_READY_S = 5.0
"""Time in which nodes find each other."""
_POLL_S = 0.02
_WATCH_S = 1.0


async def call_node(client: Client, asked: CallService) -> Any:
    """Call a service of a node, and return the values of its response."""
    service = absolute_name(asked.name)
    types = dict(client.bridge.node.get_service_names_and_types()).get(service, [])
    if not types:
        raise ConfigError(f"no node offers a service {service}")
    named = full_name("srv", asked.type)
    type_name = named if named in types else types[0]
    request = find_interface("srv", type_name).Request()
    fill(request, {} if asked.args is None or asked.args == [] else asked.args)
    response = await call_service(client, service, type_name, request, asked.timeout)
    return plain_values(response, asked.compression)


async def call_service(client: Client, service: str, type_name: str, request: Any, timeout_s: float = math.inf) -> Any:
    """Call a service of a node, given by its absolute name and the full name of its type; returns the response."""
    refuse_secrets(type_name, request)
    caller = client.bridge.service_client(service, type_name)
    return await _ask(service, caller.service_is_ready, lambda: caller.call_async(request), timeout_s)


async def _ask(name: str, is_ready: Callable[[], bool], send: Callable[[], Any], timeout_s: float = math.inf) -> Any:
    """Send a request as soon as a node is found that offers a service or action, and return the answer.

    Raises:
        ConfigError: No node offers it, the node has gone, or the time is over.
    """
    start = time.monotonic()
    while not is_ready():
        if time.monotonic() - start >= min(_READY_S, timeout_s):
            raise ConfigError(f"{name}: no node offers it with this type")
        await _wait(None, _POLL_S)
    future = send()
    while not future.done():
        left_s = start + timeout_s - time.monotonic()
        if left_s <= 0:
            raise ConfigError(f"{name}: no answer within {timeout_s:g} s")
        if not is_ready():
            raise ConfigError(f"{name}: it has gone without an answer")
        await _wait(future, min(left_s, _WATCH_S))
    return future.result()


@types.coroutine
def _wait(future: Any, seconds: float) -> Generator[tuple[Any, float], None, None]:
    """Wait until a future is done, unless it is None, or a time [s] has passed."""
    # The client of the bridge, which carries out operations, resumes this.
    yield future, seconds


@dataclass
class _Goal:
    """A goal that is under way; ``handle`` is the goal in ROS, once the action has answered."""

    asked: SendGoal
    handle: Any = None
    is_cancelled: bool = False


class Goals:
    """All goals that a client has sent and that have not ended."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._goals: list[_Goal] = []
        self._action_clients: dict[tuple[str, str], ros.ActionClient] = {}

    async def send(self, asked: SendGoal) -> None:
        """Send a goal, and answer the client with feedback and the result."""
        name, node = absolute_name(asked.name), self._client.bridge.node
        action_type = find_interface("action", asked.action_type)
        if name not in dict(ros.get_action_names_and_types(node)):
            raise ConfigError(f"no node offers an action {name}")
        message = action_type.Goal()
        fill(message, {} if asked.args is None or asked.args == [] else asked.args)
        if asked.id is not None and any(each.asked.id == asked.id for each in self._goals):
            raise ConfigError(f"send_action_goal: a goal with the id {asked.id} is under way already")
        key = name, asked.action_type
        if key not in self._action_clients:
            self._action_clients[key] = ros.ActionClient(node, action_type, name)
        goal = _Goal(asked)
        self._goals.append(goal)
        try:
            await self._follow(goal, name, self._action_clients[key], message)
        finally:
            self._goals.remove(goal)

    def cancel(self, asked: CancelGoal) -> None:
        """Ask the action to cancel a goal; the result has its answer."""
        goal = next((each for each in self._goals if each.asked.id == asked.id), None)
        if goal is None or asked.id is None:
            raise ConfigError(f"cancel_action_goal: no goal with the id {asked.id} is under way")
        goal.is_cancelled = True
        if goal.handle is not None:
            goal.handle.cancel_goal_async()

    def close(self) -> None:
        """Stop waiting for results; goals that are under way go on."""
        for client in self._action_clients.values():
            client.destroy()

    async def _follow(self, goal: _Goal, name: str, client: ros.ActionClient, message: Any) -> None:
        def send_feedback(feedback: Any) -> None:
            # Feedback after the result is dropped.
            if goal in self._goals:
                self._answer(goal.asked, "action_feedback", feedback.feedback)

        hear = send_feedback if goal.asked.feedback else None
        goal.handle = await _ask(
            name, client.server_is_ready, lambda: client.send_goal_async(message, feedback_callback=hear)
        )
        if not goal.handle.accepted:
            raise ConfigError(f"{name}: the goal was rejected, and /rosout has the reason (docs/ros.md)")
        # If the client asked to cancel the goal before the action accepted it, it is cancelled now.
        if goal.is_cancelled:
            goal.handle.cancel_goal_async()
        found = await _ask(name, client.server_is_ready, goal.handle.get_result_async)
        self._answer(goal.asked, "action_result", found.result, status=int(found.status), result=True)

    def _answer(self, asked: SendGoal, op: str, message: Any, **more: object) -> None:
        fields = {"op": op, "id": asked.id, "action": asked.name, **more}
        self._client.answer({**fields, "values": plain_values(message, asked.compression)}, asked.compression)
