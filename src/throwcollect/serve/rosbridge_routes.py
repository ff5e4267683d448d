"""The sockets of rosbridge: for a run with a given id, or for the only run that lives."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass

from fastapi import APIRouter, WebSocket

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.errors import ConflictError, NotFoundError, UnreachableError
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import Bridge, attend
from throwcollect.serve.throws import ThrowWatch

_LOOK_S = 1.0


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
    run = await asyncio.to_thread(find_run)
    async with bridges.share(run) as shared:
        await socket.accept()
        read_only = not socket.state.may_change
        await attend(socket, shared.bridge, wait_for_end(run, shared.bridge), read_only=read_only)


async def wait_for_end(run: Run, bridge: Bridge | None = None) -> None:
    """Wait until a run has ended, or its bridge is over, and raise an error then."""
    while bridge is None or not bridge.is_over:
        _refuse_ended(await asyncio.to_thread(run.now))
        await asyncio.sleep(_LOOK_S)
    raise UnreachableError("the router of the run has gone; connect again")


def _refuse_ended(run: Run) -> None:
    """Refuse a run that has ended, which has no node that could answer."""
    if run.status == "ended":
        raise NotFoundError(f"run {run.id} has ended")


def _find(instances: Instances, instance: str) -> Run:
    """The run of an id."""
    run = instances.get(instance)
    _refuse_ended(run)
    return run


def _find_only_run() -> Run:
    """The only run that lives."""
    living = [run for run in Records().all() if run.status == "running"]
    if len(living) != 1:
        number = f"{len(living)} runs live" if living else "no run lives"
        raise ConflictError(f"{number}; the path /rosbridge/RUN names one")
    return living[0]
