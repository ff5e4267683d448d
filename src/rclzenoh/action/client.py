"""Action clients, and the actions of the ROS graph, which are found by their feedback topics."""

from __future__ import annotations

import uuid
import weakref
from collections.abc import Callable
from typing import Any

from rclzenoh.graph import group_types
from rclzenoh.interfaces import Action, AnyMessage, Message
from rclzenoh.interfaces.msg import UUID, GoalInfo, GoalStatus, GoalStatusArray, Time
from rclzenoh.interfaces.srv import CancelGoal
from rclzenoh.keys import EntityKind, dds_type
from rclzenoh.node_base import NamesAndTypes, NodeBase
from rclzenoh.node_endpoints import NodeEndpoints
from rclzenoh.qos import QoSProfile, qos_profile_action_status_default
from rclzenoh.task import Future
from rclzenoh.topic import Subscription

_TOPIC, _TYPE = "/_action/feedback", "_FeedbackMessage"


FeedbackCallback = Callable[[Any], Any]


class ClientGoalHandle:
    """A goal, as its client sees it."""

    def __init__(self, client: ActionClient, goal_id: UUID, response: AnyMessage) -> None:
        self._client = client
        self.goal_id = goal_id
        self.accepted: bool = response.accepted
        self.stamp: Time = response.stamp
        self.heard_status: int = GoalStatus.STATUS_UNKNOWN

    @property
    def status(self) -> int:
        """Last state of the goal that the server has published; the client listens to states from the first call on."""
        self._client.listen_to_status()
        return self.heard_status

    def get_result_async(self) -> Future:
        """Ask for the result; the response has ``status`` and ``result``."""
        return self._client.request_result(self.goal_id)

    def cancel_goal_async(self) -> Future:
        """Ask for the goal to be cancelled; the response is that of action_msgs/srv/CancelGoal."""
        return self._client.cancel_client.call_async(CancelGoal.Request(goal_info=GoalInfo(goal_id=self.goal_id)))


class ActionClient:
    """Sends goals.

    A client subscribes to feedback when it first gets a callback for feedback, and to the status when a goal's status
    is first read, so that servers need not send messages that are not used.
    """

    def __init__(self, node: NodeEndpoints, action_type: type[Action], action_name: str) -> None:
        self._node = node
        self._action_type = action_type
        # The references are weak, because the status of a goal is needed only as long as its handle is held.
        self._handles: weakref.WeakValueDictionary[bytes, ClientGoalHandle] = weakref.WeakValueDictionary()
        self._feedback_callbacks: dict[bytes, FeedbackCallback] = {}
        protocol, prefix = action_type.Impl, f"{action_name}/_action"
        self._goal_client = node.create_client(protocol.SendGoalService, f"{prefix}/send_goal")
        self.cancel_client = node.create_client(CancelGoal, f"{prefix}/cancel_goal")
        self._result_client = node.create_client(protocol.GetResultService, f"{prefix}/get_result")
        self._feedback_topic, self._status_topic = f"{prefix}/feedback", f"{prefix}/status"
        self._feedback: Subscription | None = None
        self._status: Subscription | None = None
        self._topics = [
            (node.resolve_topic_name(self._feedback_topic), dds_type(protocol.FeedbackMessage.TYPE)),
            (node.resolve_topic_name(self._status_topic), dds_type(GoalStatusArray.TYPE)),
        ]

    def server_is_ready(self) -> bool:
        """Whether a node offers the action, with all its services and topics."""
        clients = (self._goal_client, self.cancel_client, self._result_client)
        graph = self._node.context.graph
        return all(client.service_is_ready() for client in clients) and all(
            graph.count(EntityKind.PUBLISHER, name, type_name) for name, type_name in self._topics
        )

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Wait until a node offers the action, for at most ``timeout_sec``; return whether one does.

        None or a negative time is no limit.
        """
        context = self._node.context
        return context.graph.wait_for(self.server_is_ready, timeout_sec, context.ok)

    def send_goal_async(
        self, goal: Message, feedback_callback: FeedbackCallback | None = None, goal_uuid: UUID | None = None
    ) -> Future:
        """Send a goal; the future has a `ClientGoalHandle` once the goal is accepted or rejected.

        Args:
            goal: Goal of the action's type.
            feedback_callback: Called with each feedback message, which has ``goal_id`` and ``feedback``, until the
                result has been received.
            goal_uuid: Identifier of the goal; None for a random one.
        """
        goal_id = UUID(uuid=uuid.uuid4().bytes) if goal_uuid is None else goal_uuid
        key = bytes(goal_id.uuid)
        if feedback_callback is not None:
            self._feedback_callbacks[key] = feedback_callback
            self._listen_to_feedback()

        def handle(response: AnyMessage) -> ClientGoalHandle:
            goal_handle = ClientGoalHandle(self, goal_id, response)
            if goal_handle.accepted:
                self._handles[key] = goal_handle
            else:
                self._feedback_callbacks.pop(key, None)
            return goal_handle

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
        for client in (self._goal_client, self.cancel_client, self._result_client):
            self._node.destroy_client(client)
        for subscription in (self._feedback, self._status):
            if subscription is not None:
                self._node.destroy_subscription(subscription)

    def listen_to_status(self) -> None:
        """Subscribe to the states of goals, including the present ones."""
        if self._status is None:
            self._status = self._node.create_subscription(
                GoalStatusArray, self._status_topic, self._on_status, qos_profile_action_status_default
            )

    def _listen_to_feedback(self) -> None:
        if self._feedback is None:
            feedback = self._action_type.Impl.FeedbackMessage
            self._feedback = self._node.create_subscription(
                feedback, self._feedback_topic, self._on_feedback, QoSProfile(depth=10)
            )

    def _on_feedback(self, message: AnyMessage) -> Any:
        callback = self._feedback_callbacks.get(bytes(message.goal_id.uuid))
        return callback(message) if callback is not None else None

    def _on_status(self, message: GoalStatusArray) -> None:
        for status in message.status_list:
            goal_handle = self._handles.get(bytes(status.goal_info.goal_id.uuid))
            if goal_handle is not None:
                goal_handle.heard_status = status.status


def get_action_names_and_types(node: NodeBase) -> NamesAndTypes:
    """All actions that a node offers or uses."""
    return _list_actions(node.get_topic_names_and_types())


def get_action_server_names_and_types_by_node(
    node: NodeBase, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Actions that one node offers."""
    return _list_actions(node.get_publisher_names_and_types_by_node(remote_node_name, remote_node_namespace))


def get_action_client_names_and_types_by_node(
    node: NodeBase, remote_node_name: str, remote_node_namespace: str
) -> NamesAndTypes:
    """Actions that one node has clients of."""
    return _list_actions(node.get_subscriber_names_and_types_by_node(remote_node_name, remote_node_namespace))


def _list_actions(topics: NamesAndTypes) -> NamesAndTypes:
    return group_types(
        (name.removesuffix(_TOPIC), type_name.removesuffix(_TYPE))
        for name, types in topics
        for type_name in types
        if name.endswith(_TOPIC) and type_name.endswith(_TYPE)
    )
