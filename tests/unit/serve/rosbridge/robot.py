"""A node that has one of everything, for clients of all kinds."""

from __future__ import annotations

from typing import Any

from throwcollect.ros import ActionServer, Node, get_action, get_message, get_service

String: Any = get_message("std_msgs/msg/String")
JointState: Any = get_message("sensor_msgs/msg/JointState")
SetBool: Any = get_service("std_srvs/srv/SetBool")
FJT: Any = get_action("control_msgs/action/FollowJointTrajectory")


class Robot:
    """Says ``hello`` on ``/words``, switches ``/lamp``, follows ``/follow``, and calls ``/clock`` when it is told to.

    Attributes:
        orders: What it was told on ``/orders``.
        clock: What ``/clock`` has answered.
    """

    def __init__(self, node: Node) -> None:
        self.orders: list[str] = []
        self.clock: list[Any] = []
        self._node = node
        self._words = node.create_publisher(String, "/words", 10)
        self._states = node.create_publisher(JointState, "/states", 10)
        self._timer = node.create_timer(0.02, self._speak)
        self._service = node.create_service(SetBool, "/lamp", self._switch)
        self._action = ActionServer(node, FJT, "/follow", self._follow)
        self._subscription = node.create_subscription(String, "/orders", self._obey, 10)
        node.declare_parameter("mass", 0.5)

    def _speak(self) -> None:
        if self._words.get_subscription_count():
            self._words.publish(String(data="hello"))
        if self._states.get_subscription_count():
            self._states.publish(JointState(name=["a"], position=[1.5]))

    def _switch(self, request: Any, response: Any) -> Any:
        response.success, response.message = request.data, "switched"
        return response

    def _follow(self, handle: Any) -> Any:
        handle.publish_feedback(FJT.Feedback(joint_names=handle.request.trajectory.joint_names))
        handle.succeed()
        return FJT.Result(error_string="done")

    def _obey(self, message: Any) -> None:
        self.orders.append(message.data)
        client = self._node.create_client(SetBool, "/clock")
        if "time" in message.data and client.wait_for_service(30):
            client.call_async(SetBool.Request(data=True)).add_done_callback(
                lambda future: self.clock.append(future.result())
            )
