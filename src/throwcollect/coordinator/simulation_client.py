"""One simulation as the coordinator sees it: what it is sent for a trial, and what it answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from throwcollect.ros import (
    ActionClient,
    Future,
    HistoryPolicy,
    Node,
    Parameter,
    QoSProfile,
    ReliabilityPolicy,
    get_message,
    get_service,
)
from throwcollect.trial.lease import CONTROLLERS, LEASE, NUMBER, Lease

SetParametersAtomically: Any = get_service("rcl_interfaces/srv/SetParametersAtomically")
UInt8MultiArray: Any = get_message("std_msgs/msg/UInt8MultiArray")

EPISODE_TOPIC = "episode"
EPISODE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)


class SimulationClient:
    """Clients for the services and actions of one simulation.

    Args:
        node: The coordinator.
        namespace: Namespace of the simulation, such as ``/sim_0``.
        controllers: Controllers that trials send goals to, and their names in the ROS graph.
        action_type: The FollowJointTrajectory action.
        on_episode: Called with the serialised message of an episode.
        on_refusal: Called with the reason when the simulation refuses a trial.
    """

    def __init__(
        self,
        node: Node,
        namespace: str,
        *,
        controllers: Mapping[str, str],
        action_type: Any,
        on_episode: Callable[[str, bytes], None],
        on_refusal: Callable[[str, str], None],
    ) -> None:
        self.namespace = namespace
        self.deadline = float("inf")
        """Monotonic time [s] at which the running trial counts as lost."""
        self.hung = False
        """Whether a trial was lost that way and nothing has come from the simulation since."""
        self.token = ""
        """Signature of the lease of the running trial, or of the last one."""
        self._node = node
        self._on_refusal = on_refusal
        self._generation = 0
        name = namespace.strip("/")
        self._parameters = node.create_client(SetParametersAtomically, f"{namespace}/{name}/set_parameters_atomically")
        self._actions = {
            controller: ActionClient(node, action_type, f"{namespace}/{shown}/follow_joint_trajectory")
            for controller, shown in controllers.items()
        }
        self._episodes = node.create_subscription(
            UInt8MultiArray,
            f"{namespace}/{EPISODE_TOPIC}",
            lambda message: on_episode(namespace, message),
            EPISODE_QOS,
            raw=True,
        )

    def ready(self) -> bool:
        """Whether everything that a trial needs is offered."""
        return self._parameters.service_is_ready() and all(
            action.server_is_ready() for action in self._actions.values()
        )

    def begin(self, lease: Lease, token: str, goals: Mapping[str, Any]) -> None:
        """Start a trial.

        The goals leave when the lease has been accepted, as nothing in ROS 2 says in which order a node handles
        requests to different services and actions.

        Args:
            lease: The trial.
            token: Its signature.
            goals: Joint trajectory goal of each controller, as a message.
        """
        self._generation += 1
        self.token = token
        parameters = [
            Parameter(NUMBER, value=lease.trial),
            Parameter(CONTROLLERS, value=list(lease.controllers)),
            Parameter(LEASE, value=token),
            *(Parameter(key, value=float(value)) for key, value in lease.values.items()),
        ]
        request = SetParametersAtomically.Request(parameters=[item.to_parameter_msg() for item in parameters])

        def send_goals() -> None:
            for controller, goal in goals.items():
                self._expect(self._actions[controller].send_goal_async(goal), _refusal_of(controller))

        self._expect(
            self._parameters.call_async(request),
            lambda response: None if response.result.successful else f"parameters: {response.result.reason}",
            send_goals,
        )

    def abandon(self) -> None:
        """Forget the running trial: late answers to it are ignored."""
        self._generation += 1
        self.deadline = float("inf")

    def destroy(self) -> None:
        """Take all clients off the graph."""
        self.abandon()
        for action in self._actions.values():
            action.destroy()
        self._node.destroy_subscription(self._episodes)
        self._node.destroy_client(self._parameters)

    def _expect(
        self, answer: Future, refusal: Callable[[Any], str | None], proceed: Callable[[], None] | None = None
    ) -> None:
        """Report a refusal, or else proceed, unless the trial that it concerns is over by then."""
        generation = self._generation

        def check(future: Future) -> None:
            if generation != self._generation:
                return
            if (reason := refusal(future.result())) is not None:
                self._on_refusal(self.namespace, reason)
            elif proceed is not None:
                proceed()

        answer.add_done_callback(check)


def _refusal_of(controller: str) -> Callable[[Any], str | None]:
    return lambda handle: None if handle.accepted else f"{controller} refused the goal; its log says why"
