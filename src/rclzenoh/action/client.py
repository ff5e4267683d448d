"""Action clients, and the actions of the ROS graph, which are found by their feedback topics."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from typing import Any

from rclzenoh.graph import group_types
from rclzenoh.interfaces import Action, AnyMessage, Message
from rclzenoh.interfaces.msg import UUID, GoalInfo, Time
from rclzenoh.interfaces.srv import CancelGoal
from rclzenoh.node import Node
from rclzenoh.node_base import NamesAndTypes
from rclzenoh.qos import QoSProfile
from rclzenoh.task import Future
from rclzenoh.topic import Subscription

_TOPIC, _TYPE = "/_action/feedback", "_FeedbackMessage"


class ClientGoalHandle:
    """A goal, as its client sees it."""

    def __init__(self, client: ActionClient, goal_id: UUID, response: AnyMessage) -> None:
        self._client = client
        self.goal_id = goal_id
        self.accepted: bool = response.accepted
        self.stamp: Time = response.stamp

    def get_result_async(self) -> Future:
        """Ask for the result; the response has ``status`` and ``result``."""
        return self._client.request_result(self.goal_id)

    def cancel_goal_async(self) -> Future:
        """Ask for the goal to be cancelled; the response is that of action_msgs/srv/CancelGoal."""
        return self._client.cancel_client.call_async(CancelGoal.Request(goal_info=GoalInfo(goal_id=self.goal_id)))


class ActionClient:
    """Sends goals.

    A client subscribes to feedback when it first gets a callback for feedback, so that servers need not send messages
    that are not used.
    """

    def __init__(self, node: Node, action_type: type[Action], action_name: str) -> None:
        self._node = node
        self._action_type = action_type
        self._feedback_callbacks: dict[bytes, Callable[[Any], Any]] = {}
        protocol, self._prefix = action_type.Impl, f"{action_name}/_action"
        self._goal_client = node.create_client(protocol.SendGoalService, f"{self._prefix}/send_goal")
        self.cancel_client = node.create_client(CancelGoal, f"{self._prefix}/cancel_goal")
        self._result_client = node.create_client(protocol.GetResultService, f"{self._prefix}/get_result")
        self._clients = (self._goal_client, self.cancel_client, self._result_client)
        self._feedback: Subscription | None = None

    def server_is_ready(self) -> bool:
        """Whether a node offers the action, with all its services."""
        return all(client.service_is_ready() for client in self._clients)

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Wait until a node offers the action, and return whether one does; see `Graph.wait_for`."""
        return self._node.context.graph.wait_for(self.server_is_ready, timeout_sec)

    def send_goal_async(self, goal: Message, feedback_callback: Callable[[Any], Any] | None = None) -> Future:
        """Send a goal; the future has a `ClientGoalHandle` once the goal is accepted or rejected.

        Args:
            goal: Goal of the action's type.
            feedback_callback: Called with each feedback message, which has ``goal_id`` and ``feedback``, until the
                result has been received.
        """
        goal_id = UUID(uuid=uuid.uuid4().bytes)
        key = bytes(goal_id.uuid)
        if feedback_callback is not None:
            self._feedback_callbacks[key] = feedback_callback
            if self._feedback is None:
                self._feedback = self._node.create_subscription(
                    self._action_type.Impl.FeedbackMessage,
                    f"{self._prefix}/feedback",
                    self._on_feedback,
                    QoSProfile(depth=10),
                )

        def handle(response: AnyMessage) -> ClientGoalHandle:
            if not response.accepted:
                self._feedback_callbacks.pop(key, None)
            return ClientGoalHandle(self, goal_id, response)

        request = self._action_type.Impl.SendGoalService.Request(goal_id=goal_id, goal=goal)
        return self._goal_client.call_async(request, handle)

    def request_result(self, goal_id: UUID) -> Future:
        """Ask for a goal's result; see `ClientGoalHandle.get_result_async`."""

        def take(response: Message) -> Message:
            self._feedback_callbacks.pop(bytes(goal_id.uuid), None)
            return response

        request = self._action_type.Impl.GetResultService.Request(goal_id=goal_id)
        return self._result_client.call_async(request, take)

    def destroy(self) -> None:
        """Withdraw the client; pending futures stay pending."""
        for client in self._clients:
            self._node.destroy_client(client)
        if self._feedback is not None:
            self._node.destroy_subscription(self._feedback)

    def _on_feedback(self, message: AnyMessage) -> Any:
        callback = self._feedback_callbacks.get(bytes(message.goal_id.uuid))
        return callback(message) if callback is not None else None


def get_action_names_and_types(node: Node) -> NamesAndTypes:
    """All actions that a node offers or uses."""
    return group_types(
        (name.removesuffix(_TOPIC), type_name.removesuffix(_TYPE))
        for name, types in node.get_topic_names_and_types()
        for type_name in types
        if name.endswith(_TOPIC) and type_name.endswith(_TYPE)
    )
