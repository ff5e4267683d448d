"""The sockets of rosbridge: of a run by its id, or of the only one that lives."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from fastapi import APIRouter, WebSocket

from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.runs.records import Records, Run
from throwcollect.serve.bridges import Bridges
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import attend
from throwcollect.serve.sockets import NOT_FOUND


def make_rosbridge_routes(instances: Instances, bridges: Bridges) -> APIRouter:
    """Make the routes of rosbridge."""
    router = APIRouter()

    @router.websocket("/rosbridge/{instance}")
    async def one(socket: WebSocket, instance: str) -> None:
        await _attend(socket, bridges, lambda: instances.get(instance))

    @router.websocket("/")
    async def only(socket: WebSocket) -> None:
        await _attend(socket, bridges, _find_only_run)

    return router


async def _attend(socket: WebSocket, bridges: Bridges, find_run: Callable[[], Run]) -> None:
    try:
        run = await asyncio.to_thread(find_run)
        async with bridges.bridge(run) as bridge:
            await attend(socket, bridge, read_only=not socket.scope["state"]["may_change"])
    except ThrowcollectError as error:
        await socket.close(NOT_FOUND, error.message[:120])


def _find_only_run() -> Run:
    """The only run that lives.

    Raises:
        ConflictError: If there is none, or more than one.
    """
    living = [run for run in Records().all() if run.status == "running"]
    if len(living) != 1:
        raise ConflictError(f"{len(living)} runs live", hint="/rosbridge/RUN names one")
    return living[0]
