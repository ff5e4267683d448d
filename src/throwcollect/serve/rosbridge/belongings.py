"""Topics, services and actions of one client in the ROS graph, by their names; each outlives a session."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

from throwcollect.serve.rosbridge.peer import Peer


class Belonging(Protocol):
    """Something that a client has in the ROS graph."""

    def open(self) -> None:
        """Make this topic, service or action in the session of the bridge."""

    def lose(self) -> None:
        """Forget the session, which has ended, and all messages that came by it."""

    def close(self) -> None:
        """Withdraw it."""


ABelonging = TypeVar("ABelonging", bound=Belonging)


class Belongings(Generic[ABelonging]):
    """All belongings of one kind that a client has."""

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._by_name: dict[str, ABelonging] = {}

    def lose(self) -> None:
        """Forget the session, which has ended."""
        for belonging in self._by_name.values():
            belonging.lose()

    def restore(self) -> None:
        """Make everything again, in a new session."""
        for belonging in self._by_name.values():
            belonging.open()

    def close(self) -> None:
        """Withdraw everything."""
        for belonging in self._by_name.values():
            belonging.close()
        self._by_name.clear()
