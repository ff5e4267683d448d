"""The sockets of rosbridge: for a run with a given id, or for the only run that lives."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from fastapi import APIRouter, WebSocket

from throwcollect.collect.runs.records import Records
from throwcollect.collect.runs.run import Run
from throwcollect.errors import ConflictError, NotFoundError, UnreachableError
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import Bridge, attend

_LOOK_S = 1.0


class Bridges:
    """Makes the bridge of a run for its first client, and closes it after its last."""

    def __init__(self) -> None:
        self._bridges: dict[str, Bridge] = {}
        self._clients: Counter[Bridge] = Counter()
        self._one_at_a_time = asyncio.Lock()

    @asynccontextmanager
    async def share(self, run: Run) -> AsyncIterator[Bridge]:
        """The bridge of a run, for one more client; a bridge that has lost its router is no longer used."""
        async with self._one_at_a_time:
            if (bridge := self._bridges.get(run.id)) is None or bridge.is_over:
                bridge = self._bridges[run.id] = await asyncio.to_thread(_join, run)
        self._clients[bridge] += 1
        try:
            yield bridge
        finally:
            self._clients[bridge] -= 1
            if not self._clients[bridge]:
                del self._clients[bridge]
                if self._bridges.get(run.id) is bridge:
                    del self._bridges[run.id]
                await asyncio.to_thread(bridge.close)


def _join(run: Run) -> Bridge:
    if run.connection is None:
        raise UnreachableError(f"run {run.id} has no router yet; connect again")
    run.record.middleware.joining.settle()
    return Bridge(run.connection)


def make_rosbridge_routes(instances: Instances, bridges: Bridges) -> APIRouter:
    """Make the routes of rosbridge."""
    router = APIRouter()

    @router.websocket("/rosbridge/{instance}")
    @router.websocket("/")
    async def connect(socket: WebSocket, instance: str | None = None) -> None:
        run = await asyncio.to_thread(_find_only_run if instance is None else partial(instances.get, instance))
        _refuse_ended(run)
        async with bridges.share(run) as bridge:
            await socket.accept()
            read_only = not socket.state.may_change
            await attend(socket, bridge, wait_for_end(run, bridge), read_only=read_only)

    return router


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


def _find_only_run() -> Run:
    """The only run that lives."""
    living = [run for run in Records().all() if run.status == "running"]
    if len(living) != 1:
        number = f"{len(living)} runs live" if living else "no run lives"
        raise ConflictError(f"{number}; the path /rosbridge/RUN names one")
    return living[0]
