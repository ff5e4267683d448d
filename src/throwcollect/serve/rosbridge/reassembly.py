"""Frames that a client sends in fragments."""

from __future__ import annotations

from dataclasses import dataclass, field

from throwcollect.errors import ConfigError
from throwcollect.serve.rosbridge.request import BridgeRequest, RequestId

LONGEST_FRAME = 10 * 2**20
"""Largest number of bytes of a frame that a client may send, whole or in fragments."""
_MOST_PARTS = 100_000
_OF_A_PART = 64
"""Each part counts as this many characters more than its text, because even an empty part takes memory."""


@dataclass
class _Unfinished:
    total: int
    parts: dict[int, str] = field(default_factory=dict)
    size: int = 0


class Reassembly:
    """Collects the parts of frames of one client."""

    def __init__(self) -> None:
        self._frames: dict[RequestId, _Unfinished] = {}
        self._size = 0

    def add(self, request: BridgeRequest) -> str | None:
        """Take a part.

        Returns:
            The frame, if this was its last part.
        """
        number, total = request.natural_or("num", _MOST_PARTS), request.natural_or("total", 0)
        data = request.any("data")
        if request.id is None or not isinstance(data, str) or not number < total <= _MOST_PARTS:
            raise ConfigError(
                "fragment: should have an id, the text data, and num below total",
                expected=f"at most {_MOST_PARTS} parts, counted from 0",
            )
        frame = self._frames.setdefault(request.id, _Unfinished(total))
        if number not in frame.parts:
            frame.parts[number] = data
            frame.size += len(data) + _OF_A_PART
            self._size += len(data) + _OF_A_PART
        if frame.total != total:
            self._drop(request.id)
            raise ConfigError(f"fragment: total is {total}, and was {frame.total}", expected="the same in all parts")
        if self._size > LONGEST_FRAME:
            self._drop(request.id)
            raise ConfigError(
                "fragment: the parts are too long", expected=f"at most {LONGEST_FRAME} characters together"
            )
        if len(frame.parts) < total:
            return None
        self._drop(request.id)
        return "".join(frame.parts[index] for index in range(total))

    def _drop(self, number: RequestId) -> None:
        self._size -= self._frames.pop(number).size
