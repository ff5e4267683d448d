"""Topics of the coordinator for viewers, who may subscribe late: its progress, and the newest episodes.

The newest episodes are published once a second, and only while a topic has subscribers.

Viewers must not subscribe to the episodes of a simulation themselves, because a simulation waits until all subscribers
have received each of them.
"""

from __future__ import annotations

from throwcollect.ros import DurabilityPolicy, Node, Publisher, QoSProfile, ReliabilityPolicy
from throwcollect.ros.msg import UInt8MultiArray

PROGRESS_TOPIC = "/coordinator/progress"
"""The progress: a std_msgs/String of JSON."""
PROGRESS_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

SHOWN_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""A slow subscriber misses some episodes, and delays no other node."""

_PERIOD_S = 1.0


def make_shown_topic(simulation: str) -> str:
    """Name the topic of a simulation's newest episode, by its node's name; messages are as the simulation sent them."""
    return f"/coordinator/shown/{simulation}"


class EpisodePreview:
    """Publishes the newest episode of one simulation after the other, each on the topic of its simulation."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {}
        self._newest: dict[str, bytes] = {}
        self._watched: set[str] = set()
        node.create_timer(_PERIOD_S, self._show)

    def offer(self, simulation: str, message: bytes) -> None:
        """Take in the serialised message of an episode, to be shown at its simulation's turn unless a newer one comes.

        The simulation is given by the name of its node.
        """
        if simulation not in self._publishers:
            # The publisher is made before a viewer subscribes, because reporters find the topic by it.
            topic = make_shown_topic(simulation)
            self._publishers[simulation] = self._node.create_publisher(UInt8MultiArray, topic, SHOWN_QOS)
        if simulation in self._watched:
            # A simulation whose episode is replaced keeps its turn; one that was shown goes to the end of the line.
            self._newest[simulation] = message

    def _show(self) -> None:
        self._watched = {name for name, publisher in self._publishers.items() if publisher.get_subscription_count()}
        self._newest = {name: message for name, message in self._newest.items() if name in self._watched}
        if self._newest:
            simulation = next(iter(self._newest))
            self._publishers[simulation].publish(self._newest.pop(simulation))
