"""Sockets of clients: what ends them, and the codes with which they are closed."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any

from starlette.types import Message
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from throwcollect.errors import ConfigError, ThrowcollectError

NOT_FOUND = 4404
"""Close code of a socket to something that does not exist."""
MAY_NOT = 4403
"""Close code of a socket that would change something, if the client's token allows only looking."""
FAILED = 4503
"""Close code of a socket to something that does not answer."""
BROKEN = 1011
"""Close code of a socket whose server met an unexpected error, which is in its log."""
# A control frame carries 125 bytes (RFC 6455, 5.5), and the close code takes two of them.
_MOST_REASON = 123
"""Bytes of a reason that fit into a frame."""

_logger = logging.getLogger(__name__)


async def close(socket: WebSocket, error: ThrowcollectError) -> None:
    """Close a socket because of an error, with the first line of its message, cut to the size that fits."""
    # A record that is damaged, too, describes no run any more.
    code = NOT_FOUND if isinstance(error, ConfigError) else FAILED
    first, _, _ = error.message.partition("\n")
    # If the cut goes through a character, its remaining bytes are left out.
    reason = first.encode()[:_MOST_REASON].decode(errors="ignore")
    # If the client has left meanwhile, the socket is closed already.
    with suppress(RuntimeError, WebSocketDisconnect):
        if socket.application_state is WebSocketState.CONNECTING:
            # A page learns nothing about a socket that was not accepted.
            await socket.accept()
        await socket.close(code, reason)


async def send_all(socket: WebSocket, frames: AsyncIterator[str | bytes]) -> None:
    """Send frames as they come: text in text frames, bytes in binary ones."""
    async for frame in frames:
        await (socket.send_text(frame) if isinstance(frame, str) else socket.send_bytes(frame))


async def keep_sending(
    socket: WebSocket,
    *sending: Coroutine[Any, Any, object],
    hear: Callable[[Message], Awaitable[None]] | None = None,
) -> None:
    """Let coroutines send to a client until the client has left, or one of them has nothing more to send.

    `hear` gets the messages of the client. If something fails, the socket is closed with a code; an unexpected error
    gets into the log, too.
    """

    async def wait_until_gone() -> None:
        # Only reading shows that the client has left.
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            if hear is not None:
                await hear(message)

    tasks = [asyncio.create_task(each) for each in (wait_until_gone(), *sending)]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
    for error in (task.exception() for task in tasks if not task.cancelled()):
        if isinstance(error, ThrowcollectError):
            await close(socket, error)
        elif error is not None and not isinstance(error, WebSocketDisconnect):
            try:
                await socket.close(BROKEN, "internal error")
            except (RuntimeError, WebSocketDisconnect):
                # The client has left, and sending to a closed socket fails with a RuntimeError, too.
                if isinstance(error, RuntimeError):
                    continue
            _logger.error("sending to a client failed", exc_info=error)
