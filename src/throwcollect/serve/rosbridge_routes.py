"""The sockets of rosbridge: for a run with a given id, or for the only run that lives."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass

from fastapi import APIRouter, WebSocket

from throwcollect.errors import ConflictError, ThrowcollectError, UnreachableError
from throwcollect.runs.records import Records
from throwcollect.runs.run import Run
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import Bridge, attend
from throwcollect.serve.sockets import close, refuse, refuse_ended, wait_for_end
from throwcollect.serve.throws import ThrowWatch


@dataclass
class SharedBridge:
    """The bridge of a run, what it hears of throws, and the number of its clients."""

    bridge: Bridge
    throws: ThrowWatch
    clients: int = 0


class Bridges:
    """Makes the bridge of a run for its first client, and closes it after its last."""

    def __init__(self) -> None:
        self._shared: dict[str, SharedBridge] = {}
        self._one_at_a_time = asyncio.Lock()

    @asynccontextmanager
    async def share(self, run: Run) -> AsyncIterator[SharedBridge]:
        """The bridge of a run, for one more client; a bridge that has lost its router is no longer used."""
        async with self._one_at_a_time:
            if (shared := self._shared.get(run.id)) is None or shared.bridge.is_over:
                bridge = await asyncio.to_thread(_join, run)
                shared = self._shared[run.id] = SharedBridge(bridge, ThrowWatch(run, bridge))
        shared.clients += 1
        try:
            yield shared
        finally:
            shared.clients -= 1
            if not shared.clients:
                if self._shared.get(run.id) is shared:
                    del self._shared[run.id]
                await asyncio.to_thread(shared.bridge.close)


def _join(run: Run) -> Bridge:
    if run.connection is None:
        raise UnreachableError(f"run {run.id} has no router yet; connect again")
    run.record.middleware.joining.settle()
    return Bridge(run.connection)


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
            bridge = (await stack.enter_async_context(bridges.share(run))).bridge
        except ThrowcollectError as error:
            await refuse(socket, error)
            return
        ending = asyncio.create_task(_close_at_end(socket, run, bridge))
        stack.callback(ending.cancel)
        await attend(socket, bridge, read_only=not socket.scope["state"]["may_change"])


async def _close_at_end(socket: WebSocket, run: Run, bridge: Bridge) -> None:
    try:
        await wait_for_end(run, bridge)
    except ThrowcollectError as error:
        await close(socket, error)


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
