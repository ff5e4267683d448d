"""What the parts of a client, which carry out its operations, know of the client itself and of its bridge."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from throwcollect.serve.rosbridge.bridge_session import BridgeSession
from throwcollect.serve.rosbridge.codec import Frame, encode, fragments
from throwcollect.serve.rosbridge.request import Form, RequestId

Level = Literal["info", "warning", "error"]
"""How much a status message matters."""
LEVELS = ("none", "error", "warning", "info")
"""What a client can want of status messages; each level includes those before it."""

_numbers = itertools.count()


class PeerHost(Protocol):
    """A bridge as its clients see it, as a protocol, because the module `bridge` imports the clients."""

    @property
    def is_connected(self) -> bool:
        """Whether the bridge has a place in the ROS graph by now."""

    @property
    def session(self) -> BridgeSession:
        """The bridge's place in the ROS graph."""

    @property
    def offered(self) -> set[str]:
        """The services by which one knows what the clients of the bridge offer; all clients share this set."""

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Call an action after a time [s], in the bridge's thread."""

    def submit(self, action: Callable[[], None]) -> None:
        """Call an action soon, in the bridge's thread; may be called in any thread."""

    def forget(self, client: Peer) -> None:
        """Take a client off the list."""


class Peer:
    """A client, as its parts see it: they send messages to it. Only the thread of the bridge calls these methods.

    Args:
        host: The bridge that the client is connected to.
        send: Sends a frame to the client, and neither waits nor fails.
    """

    def __init__(self, host: PeerHost, send: Callable[[Frame], None]) -> None:
        self.host = host
        self._send = send
        self._level = "error"
        self._is_closed = False

    def send(self, frame: Frame, fragment_size: int = 0) -> None:
        """Send a frame, in parts if it is a text longer than ``fragment_size``, unless that is 0."""
        if self._is_closed:
            return
        if isinstance(frame, str) and 0 < fragment_size < len(frame):
            for part in fragments(frame, fragment_size, str(next(_numbers))):
                self._send(part)
        else:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], form: Form) -> None:
        """Send an operation; fields that are None are left out."""
        filled = {name: value for name, value in fields.items() if value is not None}
        self.send(encode(filled, form.compression), form.fragment_size)

    def say(self, level: Level, text: str, request: RequestId = None) -> None:
        """Send a status message about a request, if the client wants messages of this level."""
        if LEVELS.index(level) <= LEVELS.index(self._level):
            self.answer({"op": "status", "id": request, "level": level, "msg": text}, Form())
