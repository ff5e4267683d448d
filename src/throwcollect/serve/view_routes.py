"""What the page draws: descriptions, meshes, the newest throws, and simulations that are slowed down to be watched."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from fastapi import APIRouter, Request, Response, WebSocket
from fastapi.responses import FileResponse

from throwcollect.errors import ThrowcollectError
from throwcollect.serve.instances import Instances
from throwcollect.serve.live import LiveHolds
from throwcollect.serve.robot_files import description_of, find_mesh
from throwcollect.serve.sockets import NOT_FOUND, keep_telling
from throwcollect.serve.throws import ThrowWatch

_XML = {"requestBody": {"required": True, "content": {"application/xml": {"schema": {"type": "string"}}}}}


def make_view_routes(instances: Instances, holds: LiveHolds) -> APIRouter:
    """Routes on what the page draws.

    Args:
        instances: All runs.
        holds: Simulations that are slowed down to be watched.
    """
    router = APIRouter()
    watches: dict[str, ThrowWatch] = {}

    @router.get("/instances/{instance}/urdf", response_class=Response)
    def urdf(instance: str) -> Response:
        """The robot of a run, with its tool, in URDF; meshes are ``package://`` URLs."""
        return Response(description_of(instances.get(instance)), media_type="application/xml")

    @router.put("/instances/{instance}/urdf", status_code=202, openapi_extra=_XML)
    async def show(instance: str, request: Request) -> None:
        """Have viewers draw another description, which may differ in what is seen."""
        urdf = (await request.body()).decode(errors="replace")
        await asyncio.to_thread(instances.show, instance, urdf)

    @router.delete("/instances/{instance}/urdf", status_code=202)
    def show_own(instance: str) -> None:
        """Have viewers draw the description of the configuration again."""
        instances.show(instance, None)

    @router.get("/meshes/{package}/{path:path}", response_class=FileResponse)
    def mesh(package: str, path: str) -> FileResponse:
        """The file of a mesh."""
        return FileResponse(find_mesh(package, path), headers={"Cache-Control": "private, max-age=86400"})

    @router.websocket("/instances/{instance}/shown")
    async def shown(socket: WebSocket, instance: str) -> None:
        try:
            run = await asyncio.to_thread(instances.get, instance)
        except ThrowcollectError:
            await socket.close(NOT_FOUND, f"no run {instance}")
            return
        await socket.accept()
        watch = watches.setdefault(instance, ThrowWatch(run))
        async with watch.throws() as next_throw:
            await keep_telling(socket, lambda: _send_next(socket, next_throw))

    @router.websocket("/instances/{instance}/live/{simulation}")
    async def live(socket: WebSocket, instance: str, simulation: str) -> None:
        try:
            run = await asyncio.to_thread(instances.get, instance)
            hold = await holds.take(run, simulation)
        except ThrowcollectError as error:
            await socket.close(NOT_FOUND, error.message[:120])
            return
        try:
            await socket.accept()
            await keep_telling(socket, asyncio.Event().wait)
        finally:
            await hold.let_go()

    return router


async def _send_next(socket: WebSocket, next_throw: Callable[[], Awaitable[bytes]]) -> None:
    while True:
        await socket.send_bytes(await next_throw())
