"""Sockets that only tell."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from starlette.websockets import WebSocket

from throwcollect.errors import ThrowcollectError

NOT_FOUND = 4404
"""Code with which a socket to what does not exist is closed."""
MAY_NOT = 4403
"""The same for one that would change something, while its token may only look."""
FAILED = 4503
"""The same for one to what does not answer."""
_MOST_REASON = 123
"""Bytes of a reason that a frame has room for."""


async def refuse(socket: WebSocket, code: int, reason: str) -> None:
    """Close a socket at once, so that its client learns why: of one that is not accepted, browsers tell nothing.

    Args:
        socket: The socket, not accepted yet.
        code: The code.
        reason: The reason; its first line, as far as there is room for it.
    """
    await socket.accept()
    await socket.close(code, _cut(reason))


def _cut(reason: str) -> str:
    first, _, _ = reason.partition("\n")
    return first.encode()[:_MOST_REASON].decode(errors="ignore")


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
        await asyncio.wait(tasks)
    for error in (task.exception() for task in tasks if not task.cancelled()):
        if isinstance(error, ThrowcollectError):
            await socket.close(FAILED, _cut(error.message))
