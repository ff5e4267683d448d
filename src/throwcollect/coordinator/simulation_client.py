"""One simulation as the coordinator sees it: what it is sent for a trial, and what it answers."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from typing import Any
from uuid import uuid4

from throwcollect.ros import (
    Future,
    HistoryPolicy,
    Node,
    Parameter,
    QoSProfile,
    ReliabilityPolicy,
)
from throwcollect.ros.action import FollowJointTrajectory
from throwcollect.ros.msg import UUID, UInt8MultiArray
from throwcollect.ros.srv import SetParametersAtomically
from throwcollect.trial.lease import CONTROLLERS, LEASE, NUMBER, Lease

_LEASE = "the lease"
_ANSWER_S = 5.0
"""Lease and goals are answered within milliseconds, before anything is simulated; whatever is not answered in this real
time went astray, as on the way through a router that was started again."""

EPISODE_TOPIC = "episode"
EPISODE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)


class SimulationClient:
    """Clients for the services and actions of one simulation.

    Args:
        node: The coordinator.
        namespace: Namespace of the simulation, such as ``/sim_0`` or ``/``.
        name: Name of its node there.
        publishers: Identifiers of its publishers of episodes: a simulation that is started again has other ones.
        controllers: Controllers that trials send goals to, and their names in the ROS graph.
        action_type: The FollowJointTrajectory action.
        on_episode: Called with the serialised message of an episode.
        on_refusal: Called with the reason when the simulation refuses a trial.
    """

    def __init__(
        self,
        node: Node,
        namespace: str,
        name: str,
        publishers: AbstractSet[bytes],
        *,
        controllers: Mapping[str, str],
        action_type: type[FollowJointTrajectory],
        on_episode: Callable[[str, bytes], None],
        on_refusal: Callable[[str, str], None],
    ) -> None:
        self.namespace = namespace
        self.name = name
        self.publishers = publishers
        self.deadline = float("inf")
        """Monotonic time [s] at which the running trial counts as lost."""
        self.hung = False
        """Whether a trial was lost that way and nothing has come from the simulation since."""
        self.token = ""
        """Signature of the lease of the running trial, or of the last one."""
        self.unanswered: list[str] = []
        """What the simulation was sent for the running trial and has not answered yet."""
        self._node = node
        self._on_refusal = on_refusal
        self._generation = 0
        self._sent: tuple[Lease, Mapping[str, Any]]
        self._sent_at = self._patience_s = 0.0
        prefix = namespace.removesuffix("/")
        self._parameters = node.create_client(SetParametersAtomically, f"{prefix}/{name}/set_parameters_atomically")
        # Of the action, the service that takes goals is all that is needed. A whole action client would also subscribe
        # to the feedback, and simulations advance in short slices of time while somebody listens to that.
        self._send_goal = action_type.Impl.SendGoalService
        self._goals = {
            controller: node.create_client(
                self._send_goal, f"{prefix}/{shown}/follow_joint_trajectory/_action/send_goal"
            )
            for controller, shown in controllers.items()
        }
        self._episodes = node.create_subscription(
            UInt8MultiArray,
            f"{prefix}/{EPISODE_TOPIC}",
            lambda message: on_episode(namespace, message),
            EPISODE_QOS,
            raw=True,
        )

    def ready(self) -> bool:
        """Whether everything that a trial needs is offered."""
        return all(client.service_is_ready() for client in (self._parameters, *self._goals.values()))

    def begin(self, lease: Lease, token: str, goals: Mapping[str, FollowJointTrajectory.Goal]) -> None:
        """Start a trial.

        The goals leave when the lease has been accepted, as nothing in ROS 2 says in which order a node handles
        requests to different services and actions.

        Args:
            lease: The trial.
            token: Its signature.
            goals: Joint trajectory goal of each controller, as a message.
        """
        self.token = token
        self._patience_s = _ANSWER_S
        self._send(lease, goals)

    def remind(self) -> str | None:
        """Start the trial once more if something that was sent has had no answer; a trial may be started twice.

        Returns:
            What had no answer; None if there is nothing to remind of yet.
        """
        if not self.unanswered or time.monotonic() < self._sent_at + self._patience_s:
            return None
        missing = self.unanswered[0]
        # A simulation that was frozen for a while shall not find a pile of requests.
        self._patience_s *= 2
        self._send(*self._sent)
        return missing

    def abandon(self) -> None:
        """Forget the running trial: late answers to it are ignored."""
        self._generation += 1
        self.unanswered = []
        self.deadline = float("inf")

    def destroy(self) -> None:
        """Take all clients off the graph."""
        self.abandon()
        for client in (self._parameters, *self._goals.values()):
            self._node.destroy_client(client)
        self._node.destroy_subscription(self._episodes)

    def _send(self, lease: Lease, goals: Mapping[str, FollowJointTrajectory.Goal]) -> None:
        self._generation += 1
        self._sent, self._sent_at = (lease, goals), time.monotonic()
        self.unanswered = [_LEASE, *goals]
        parameters = [
            Parameter(NUMBER, value=lease.trial),
            Parameter(CONTROLLERS, value=list(lease.controllers)),
            Parameter(LEASE, value=self.token),
            *(Parameter(key, value=float(value)) for key, value in lease.values.items()),
        ]
        request = SetParametersAtomically.Request(parameters=[item.to_parameter_msg() for item in parameters])

        def send_goals() -> None:
            for controller, goal in goals.items():
                goal_id = UUID(uuid=list(uuid4().bytes))
                answer = self._goals[controller].call_async(self._send_goal.Request(goal_id=goal_id, goal=goal))
                self._expect(controller, answer, _refusal_of(controller))

        self._expect(
            _LEASE,
            self._parameters.call_async(request),
            lambda response: None if response.result.successful else f"parameters: {response.result.reason}",
            send_goals,
        )

    def _expect(
        self,
        sent: str,
        answer: Future,
        refusal: Callable[[Any], str | None],
        proceed: Callable[[], None] | None = None,
    ) -> None:
        """Report a refusal, or else proceed, unless the trial that it concerns is over by then."""
        generation = self._generation

        def check(future: Future) -> None:
            if generation != self._generation:
                return
            self.unanswered.remove(sent)
            if (reason := refusal(future.result())) is not None:
                self._on_refusal(self.namespace, reason)
            elif proceed is not None:
                proceed()

        answer.add_done_callback(check)


def _refusal_of(controller: str) -> Callable[[Any], str | None]:
    return lambda response: None if response.accepted else f"{controller} refused the goal; its log says why"
