"""How one client of a bridge is answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.codec import Frame, encode


class Client:
    """A client of a bridge; only the thread of the bridge calls these methods.

    Attributes:
        bridge: The bridge that the client is connected to.
        is_closed: Whether the client has left.
    """

    def __init__(self, bridge: Bridge, send: Callable[[Frame], None]) -> None:
        self.bridge = bridge
        self.is_closed = False
        self._send = send

    def send(self, frame: Frame) -> None:
        """Send a frame, unless the client has left."""
        if not self.is_closed:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], compression: str = "none") -> None:
        """Send an operation; fields that are None are left out."""
        self.send(encode({name: value for name, value in fields.items() if value is not None}, compression))
