"""The sockets of rosbridge: of a run by its id, or of the only one that lives."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, WebSocket

from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.runs.records import Records, Run
from throwcollect.serve.bridges import Bridges
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import attend
from throwcollect.serve.sockets import NOT_FOUND


def make_rosbridge_routes(instances: Instances, bridges: Bridges) -> APIRouter:
    """Routes of rosbridge.

    Args:
        instances: All runs.
        bridges: One bridge for each run that somebody is connected to.
    """
    router = APIRouter()

    @router.websocket("/rosbridge/{instance}")
    async def one(socket: WebSocket, instance: str) -> None:
        try:
            run = await asyncio.to_thread(instances.get, instance)
        except ThrowcollectError as error:
            await socket.close(NOT_FOUND, error.message[:120])
            return
        await _attend(socket, bridges, run)

    @router.websocket("/")
    async def only(socket: WebSocket) -> None:
        try:
            run = await asyncio.to_thread(_find_only_run)
        except ThrowcollectError as error:
            await socket.close(NOT_FOUND, error.message[:120])
            return
        await _attend(socket, bridges, run)

    return router


async def _attend(socket: WebSocket, bridges: Bridges, run: Run) -> None:
    try:
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
