"""The interfaces of a client and its bridge for the parts of the client, which carry out its operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from throwcollect.serve.rosbridge.bridge_session import BridgeSession
from throwcollect.serve.rosbridge.codec import Frame
from throwcollect.serve.rosbridge.request import Form, RequestId

Level = Literal["info", "warning", "error"]
"""How much a status message matters."""


class PeerHost(Protocol):
    """A bridge as the parts of its clients see it."""

    @property
    def session(self) -> BridgeSession:
        """The bridge's place in the ROS graph."""

    @property
    def offered(self) -> set[str]:
        """The services by which one knows what the clients of the bridge offer; all clients share this set."""

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Call an action after a time [s], in the bridge's thread."""


class Peer(Protocol):
    """A client. Only the thread of the bridge calls these methods."""

    @property
    def host(self) -> PeerHost:
        """The bridge that the client is connected to."""

    def send(self, frame: Frame, fragment_size: int = 0) -> None:
        """Send a frame, in parts if it is a text longer than ``fragment_size``, unless that is 0."""

    def answer(self, fields: Mapping[str, object], form: Form) -> None:
        """Send an operation; fields that are None are left out."""

    def say(self, level: Level, text: str, request: RequestId = None) -> None:
        """Send a status message about a request, if the client wants messages of this level."""
