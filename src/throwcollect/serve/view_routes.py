"""REST and sockets on what the page draws: descriptions, meshes, the newest throws, and simulations in real time."""

from __future__ import annotations

import asyncio
from contextlib import aclosing

from fastapi import APIRouter, Request, Response, WebSocket
from fastapi.responses import FileResponse

from throwcollect.collect.runs.run import Run
from throwcollect.serve.access import MAY_ONLY_LOOK
from throwcollect.serve.instances import Instances
from throwcollect.serve.live import restore_speed, slow_down
from throwcollect.serve.robot_files import (
    MeshFile,
    SceneFacts,
    description_of,
    find_mesh,
    find_mesh_by_content,
    list_meshes,
    scene_of,
)
from throwcollect.serve.rosbridge_routes import Bridges, wait_for_end
from throwcollect.serve.sockets import MAY_NOT, keep_sending, send_all
from throwcollect.serve.throws import hear_throws

_XML = {"requestBody": {"required": True, "content": {"application/xml": {"schema": {"type": "string"}}}}}


class Xml(Response):
    """An answer in XML."""

    media_type = "application/xml"


def make_view_routes(instances: Instances, bridges: Bridges) -> APIRouter:
    """Make the routes on what the page draws."""
    router = APIRouter()

    @router.get("/instances/{instance}/urdf", response_class=Xml)
    def urdf(instance: str) -> Response:
        """The robot of a run, with its tool, in URDF; meshes are ``package://`` URLs."""
        return Xml(description_of(instances.get(instance)))

    @router.get("/instances/{instance}/meshes")
    def meshes(instance: str) -> list[MeshFile]:
        """The meshes that the robot of a run is drawn with; clients get their contents by their SHA-256."""
        return list_meshes(description_of(instances.get(instance)))

    @router.get("/instances/{instance}/scene")
    def scene(instance: str) -> SceneFacts:
        """Heights, distances and bodies in the scene of a run, which viewers need besides the robot."""
        return scene_of(instances.get(instance))

    @router.put("/instances/{instance}/urdf", status_code=202, openapi_extra=_XML)
    async def show(instance: str, request: Request) -> None:
        """Let viewers draw another description, which may differ from that of the configuration only in appearance."""
        urdf = (await request.body()).decode(errors="replace")
        await asyncio.to_thread(instances.show, instance, urdf)

    @router.delete("/instances/{instance}/urdf", status_code=202)
    def show_own(instance: str) -> None:
        """Let viewers draw the description of the configuration again."""
        instances.show(instance, None)

    @router.get("/meshes/{package}/{path:path}", response_class=FileResponse)
    def mesh(package: str, path: str) -> FileResponse:
        """The file of a mesh, as the description names it."""
        return FileResponse(find_mesh(package, path), headers={"Cache-Control": "private, max-age=86400"})

    @router.get("/meshes/{sha256}", response_class=FileResponse)
    def mesh_by_content(sha256: str) -> FileResponse:
        """The file of a mesh by the SHA-256 of its content, so it never changes."""
        headers = {"Cache-Control": "private, max-age=31536000, immutable", "ETag": f'"{sha256}"'}
        return FileResponse(find_mesh_by_content(sha256), headers=headers)

    @router.websocket("/instances/{instance}/shown")
    async def stream_throws(socket: WebSocket, instance: str) -> None:
        run = await asyncio.to_thread(instances.get, instance)
        async with bridges.share(run) as bridge, aclosing(hear_throws(run, bridge)) as throws:
            await socket.accept()
            await keep_sending(socket, send_all(socket, throws), wait_for_end(run, bridge))

    @router.websocket("/instances/{instance}/live/{simulation}")
    async def live(socket: WebSocket, instance: str, simulation: str) -> None:
        if not socket.state.may_change:
            await socket.accept()
            await socket.close(MAY_NOT, MAY_ONLY_LOOK[1])
        else:
            await _keep_slow(socket, await asyncio.to_thread(instances.get, instance), simulation)

    return router


async def _keep_slow(socket: WebSocket, run: Run, simulation: str) -> None:
    """Keep a simulation slow as long as a client is connected; nothing is ever sent to it."""
    lock = await asyncio.to_thread(slow_down, run, simulation)
    try:
        await socket.accept()
        await keep_sending(socket, wait_for_end(run))
    finally:
        await asyncio.to_thread(restore_speed, run, simulation, lock)
