"""The services of rosapi, by which clients look around in the ROS graph; the bridge answers them itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from throwcollect.ros.names import is_hidden
from throwcollect.serve.rosbridge.guarded import is_guarded
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.service_calls import Call

Answer = Callable[[Call], None]


class Rosapi:
    """The services of rosapi for one client.

    Args:
        client: The client.

    Attributes:
        answers: What answers each service, by its name without a slash at its beginning.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self.answers: Mapping[str, Answer] = {"rosapi/topics": self._topics}

    def _visible_topics(self) -> list[tuple[str, str]]:
        found = self._client.session.node.get_topic_names_and_types()
        return sorted((name, types[0]) for name, types in found if not (is_hidden(name) or is_guarded(name)))

    def _topics(self, call: Call) -> None:
        topics = self._visible_topics()
        call.reply({"topics": [name for name, _ in topics], "types": [kind for _, kind in topics]})
