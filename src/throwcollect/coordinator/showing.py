"""Shows the newest episodes to whoever looks on: once a second, and only while somebody does.

Nobody but the coordinator may subscribe to the episodes themselves: a simulation waits until all who do have got each.
"""

from __future__ import annotations

from throwcollect.coordinator.topics import SHOWN_QOS, SHOWN_TOPIC
from throwcollect.ros import Node
from throwcollect.ros.msg import UInt8MultiArray

_PERIOD_S = 1.0


class Showing:
    """Publishes the newest episode of one simulation after the other.

    Args:
        node: The coordinator.
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(UInt8MultiArray, SHOWN_TOPIC, SHOWN_QOS)
        self._newest: dict[str, bytes] = {}
        self._is_watched = False
        node.create_timer(_PERIOD_S, self._show)

    def offer(self, namespace: str, message: bytes) -> None:
        """Take in an episode, to be shown when it is its simulation's turn, unless there is a newer one by then.

        Args:
            namespace: Namespace of the simulation.
            message: Serialised message of the episode.
        """
        if self._is_watched:
            # A simulation whose episode is replaced keeps its turn; one that was shown goes to the end of the line.
            self._newest[namespace] = message

    def _show(self) -> None:
        self._is_watched = self._publisher.get_subscription_count() > 0
        if not self._is_watched:
            self._newest.clear()
        elif self._newest:
            self._publisher.publish(self._newest.pop(next(iter(self._newest))))
