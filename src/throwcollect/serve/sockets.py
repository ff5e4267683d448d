"""Sockets that only tell."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from starlette.websockets import WebSocket

NOT_FOUND = 4404
"""Code with which a socket to what does not exist is closed."""


async def keep_telling(socket: WebSocket, tell: Callable[[], Awaitable[object]]) -> None:
    """Tell a client something until it has gone, or there is nothing more to tell.

    Args:
        socket: Its socket, accepted.
        tell: Tells all there is, one message after the other.
    """

    async def hear() -> None:
        # Nothing is heeded; but without this, nobody would notice that the client has gone.
        while (await socket.receive())["type"] != "websocket.disconnect":
            pass

    async def speak() -> None:
        await tell()

    tasks = [asyncio.create_task(hear()), asyncio.create_task(speak())]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
