"""Sockets on which the server sends and the client only listens, until their run has ended."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from throwcollect.errors import ConfigError, NotFoundError, ThrowcollectError, UnreachableError
from throwcollect.runs.run import Run
from throwcollect.serve.rosbridge import Bridge

_LOOK_S = 1.0


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


async def refuse(socket: WebSocket, error: ThrowcollectError) -> None:
    """Accept a socket and close it at once, because a page learns nothing about a socket that was not accepted."""
    await socket.accept()
    await close(socket, error)


async def close(socket: WebSocket, error: ThrowcollectError) -> None:
    """Close a socket because of an error, with the first line of its message, cut to the size that fits."""
    # A record that is damaged, too, describes no run any more.
    code = NOT_FOUND if isinstance(error, ConfigError) else FAILED
    first, _, _ = error.message.partition("\n")
    # If the cut goes through a character, its remaining bytes are left out.
    reason = first.encode()[:_MOST_REASON].decode(errors="ignore")
    # If the client has left meanwhile, the socket is closed already.
    with suppress(RuntimeError, WebSocketDisconnect):
        await socket.close(code, reason)


async def keep_telling(socket: WebSocket, *telling: Coroutine[Any, Any, object]) -> None:
    """Let coroutines send to a client until the client has left, or one of them has nothing more to send.

    If one of them fails, the socket is closed with a code; an unexpected error gets into the log, too.
    """

    async def wait_until_gone() -> None:
        # Messages of the client are ignored, but only reading shows that it has left.
        while (await socket.receive())["type"] != "websocket.disconnect":
            pass

    tasks = [asyncio.create_task(each) for each in (wait_until_gone(), *telling)]
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
            _logger.error("telling a client failed", exc_info=error)


def refuse_ended(run: Run) -> None:
    """Refuse a run that has ended, so that nobody would ever answer."""
    if run.status == "ended":
        raise NotFoundError(f"run {run.id} has ended")


async def wait_for_end(run: Run, bridge: Bridge | None = None) -> None:
    """Wait until a run has ended, or its bridge is over, and raise an error then.

    Raises:
        NotFoundError: If the run has ended, or was forgotten.
        ConfigError: If its record is damaged.
        UnreachableError: If the router has gone; the one that comes next needs another bridge.
    """
    while bridge is None or not bridge.is_over:
        refuse_ended(await asyncio.to_thread(run.now))
        await asyncio.sleep(_LOOK_S)
    raise UnreachableError("the router of the run has gone; connect again")
