"""A bridge over WebSockets of Starlette."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Coroutine
from contextlib import suppress
from typing import Any

from starlette.types import Message
from starlette.websockets import WebSocket

from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.codec import Frame, json_text
from throwcollect.serve.rosbridge.requests import Requests
from throwcollect.serve.sockets import keep_sending, send_all

MOST_FRAMES = 1000
MOST_BYTES = 32 * 2**20
"""Limits of frames that wait for a client that reads slowly; beyond either limit, the oldest frames are dropped."""

_MOST_WAITING = 100
_POLL_S = 0.01
_DROPPED = json_text(
    {
        "op": "status",
        "level": "warning",
        "msg": "frames come faster than they are read, so the oldest are dropped; throttle_rate asks for fewer",
    }
)


class Outbox:
    """Frames that wait to be sent; any thread may add frames, the rest belongs to the thread of the event loop."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._frames: deque[Frame] = deque()
        self._bytes = 0
        self._is_reported = False
        self._filled = asyncio.Event()

    def put(self, frame: Frame) -> None:
        """Add a frame; the oldest frames are dropped if too much waits."""
        # The loop may have ended, and with it the connection.
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._append, frame)

    async def take_all(self) -> AsyncIterator[Frame]:
        """Take the oldest frame, as soon as there is one, again and again."""
        while await self._filled.wait():
            frame = self._frames.popleft()
            self._bytes -= len(frame)
            if not self._frames:
                self._filled.clear()
            yield frame

    def _append(self, frame: Frame) -> None:
        self._frames.append(frame)
        self._bytes += len(frame)
        self._filled.set()
        # A single frame is kept however long it is.
        while len(self._frames) > MOST_FRAMES or (self._bytes > MOST_BYTES and len(self._frames) > 1):
            self._bytes -= len(self._frames.popleft())
            if not self._is_reported:
                self._is_reported = True
                self._append(_DROPPED)


async def attend(websocket: WebSocket, bridge: Bridge, *until: Coroutine[Any, Any, object], read_only: bool) -> None:
    """Connect the accepted WebSocket of a client to a bridge until it leaves, or one of the coroutines ends."""
    outbox = Outbox()
    client = Requests(bridge, outbox.put, read_only=read_only)

    async def hear(message: Message) -> None:
        text: str | None = message.get("text")
        client.receive(message["bytes"] if text is None else text)
        # If a client sends faster than the bridge works, its frames are not read for a while, so TCP makes it wait.
        while client.waiting > _MOST_WAITING and not bridge.is_over:
            await asyncio.sleep(_POLL_S)

    try:
        await keep_sending(websocket, send_all(websocket, outbox.take_all()), *until, hear=hear)
    finally:
        client.close()
