"""The sockets of rosbridge: for a run with a given id, or for the only run that lives."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass

from fastapi import APIRouter, WebSocket

from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.ros.connection import Connection
from throwcollect.runs.records import Records
from throwcollect.runs.run import Run
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import Bridge, attend
from throwcollect.serve.sockets import NOT_FOUND, close, refuse, refuse_ended, wait_for_end

_LOOK_S = 0.5


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
        """The bridge of a run, for one more client."""
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


def make_rosbridge_routes(instances: Instances, bridges: Bridges) -> APIRouter:
    """Make the routes of rosbridge."""
    router = APIRouter()

    @router.websocket("/rosbridge/{instance}")
    async def one(socket: WebSocket, instance: str) -> None:
        await _attend(socket, bridges, lambda: _find(instances, instance))

    @router.websocket("/")
    async def only(socket: WebSocket) -> None:
        await _attend(socket, bridges, _find_only_run)

    return router


async def _attend(socket: WebSocket, bridges: Bridges, find_run: Callable[[], Run]) -> None:
    async with AsyncExitStack() as stack:
        try:
            run = await asyncio.to_thread(find_run)
            bridge = await stack.enter_async_context(bridges.bridge(run))
        except ThrowcollectError as error:
            await refuse(socket, NOT_FOUND, error.message)
            return
        ending = asyncio.create_task(_close_at_end(socket, run))
        stack.callback(ending.cancel)
        await attend(socket, bridge, read_only=not socket.scope["state"]["may_change"])


async def _close_at_end(socket: WebSocket, run: Run) -> None:
    try:
        await wait_for_end(run)
    except ThrowcollectError as error:
        # If the client has left meanwhile, the socket is closed already.
        with suppress(RuntimeError):
            await close(socket, NOT_FOUND, error.message)


def _find(instances: Instances, instance: str) -> Run:
    """The run of an id."""
    run = instances.get(instance)
    refuse_ended(run)
    return run


def _find_only_run() -> Run:
    """The only run that lives."""
    living = [run for run in Records().all() if run.status == "running"]
    if len(living) != 1:
        number = f"{len(living)} runs live" if living else "no run lives"
        raise ConflictError(f"{number}; the path /rosbridge/RUN names one")
    return living[0]
