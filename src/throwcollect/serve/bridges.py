"""Bridges of rosbridge: one for each run that clients are connected to, as long as there is a client."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.ros.connection import Connection
from throwcollect.runs.records import Run
from throwcollect.serve.rosbridge import Bridge

_MOST_CLIENTS = 16
_LOOK_S = 0.5


class FullError(ConflictError):
    """The largest number of clients is connected."""


@dataclass
class _Shared:
    bridge: Bridge
    following: asyncio.Task[None]
    clients: int = 0


class Bridges:
    """Makes the bridge of a run for its first client, and closes it after its last."""

    def __init__(self) -> None:
        self._shared: dict[str, _Shared] = {}

    @asynccontextmanager
    async def bridge(self, run: Run) -> AsyncIterator[Bridge]:
        """The bridge of a run, for one more client.

        Raises:
            FullError: If the clients of all runs together have reached their largest number.
        """
        if sum(each.clients for each in self._shared.values()) >= _MOST_CLIENTS:
            raise FullError(f"{_MOST_CLIENTS} clients are connected by rosbridge, which is the limit")
        if (shared := self._shared.get(run.id)) is None:
            run.record.middleware.joining.settle()
            bridge = Bridge(run.connection)
            shared = self._shared[run.id] = _Shared(bridge, asyncio.create_task(_follow(run, bridge)))
        shared.clients += 1
        try:
            yield shared.bridge
        finally:
            shared.clients -= 1
            if not shared.clients:
                del self._shared[run.id]
                shared.following.cancel()
                await asyncio.to_thread(shared.bridge.close)


async def _follow(run: Run, bridge: Bridge) -> None:
    """Give a bridge the connection to the router of its run whenever the connection changes."""
    known = run.connection
    while True:
        await asyncio.sleep(_LOOK_S)
        connection: Connection | None = None
        # A run that was forgotten raises an error, and has no router.
        with suppress(ThrowcollectError):
            connection = (await asyncio.to_thread(run.now)).connection
        if connection != known:
            known = connection
            bridge.move(connection)
