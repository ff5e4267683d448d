"""The sockets of rosbridge: for a run with a given id, or for the only run that lives."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import AsyncExitStack, suppress

from fastapi import APIRouter, WebSocket

from throwcollect.errors import ConflictError, ThrowcollectError
from throwcollect.runs.records import Records, Run
from throwcollect.serve.bridges import Bridges, FullError
from throwcollect.serve.instances import Instances
from throwcollect.serve.rosbridge import attend
from throwcollect.serve.run_end import refuse_ended, wait_for_end
from throwcollect.serve.sockets import FULL, NOT_FOUND, close, refuse


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
            await refuse(socket, FULL if isinstance(error, FullError) else NOT_FOUND, error.message)
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
