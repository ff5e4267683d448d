"""How one client of a bridge is answered."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.codec import Frame, encode, fragments
from throwcollect.serve.rosbridge.operations import Form, RequestId

_PLAIN = Form()
_numbers = itertools.count()


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

    def send(self, frame: Frame, fragment_size: int = 0) -> None:
        """Send a frame, in parts if it is a string longer than ``fragment_size``, unless that is 0."""
        if self.is_closed:
            return
        if isinstance(frame, str) and 0 < fragment_size < len(frame):
            for part in fragments(frame, fragment_size, str(next(_numbers))):
                self._send(part)
        else:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], form: Form = _PLAIN) -> None:
        """Send an operation; fields that are None are left out."""
        filled = {name: value for name, value in fields.items() if value is not None}
        self.send(encode(filled, form.compression), form.fragment_size)

    def report(self, text: str, number: RequestId = None) -> None:
        """Send a status message that the operation with this id has failed."""
        self.answer({"op": "status", "id": number, "level": "error", "msg": text})
