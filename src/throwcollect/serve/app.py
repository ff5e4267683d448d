"""The application: REST, the socket of the state, and the page."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, FastAPI, Query, Response, WebSocket
from fastapi.responses import FileResponse, PlainTextResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict, Field, JsonValue

from throwcollect.errors import ThrowcollectError
from throwcollect.runs.events import EVENTS
from throwcollect.runs.record import Origin
from throwcollect.runtimes.node_logs import NodeLogs
from throwcollect.serve.access import Keys
from throwcollect.serve.instances import Instances
from throwcollect.serve.problems import add_handlers, problem
from throwcollect.serve.robot_files import description_of, find_mesh
from throwcollect.serve.sockets import keep_telling
from throwcollect.serve.state import ComponentState, InstanceState, Lookout, State, describe
from throwcollect.serve.throws import ThrowWatch
from throwcollect.serve.watching import StateWatch
from throwcollect.version import __version__

PREFIX = "/api/v1"
_PAGE = Path(__file__).parent / "page"


class Wish(BaseModel):
    """What a client asks for: an instance of a component."""

    model_config = ConfigDict(extra="forbid")

    component: str
    simulations: int | None = Field(default=None, ge=1, le=256)
    set: dict[str, JsonValue] = Field(default_factory=dict)


class Scaling(BaseModel):
    """Another number of simulations."""

    model_config = ConfigDict(extra="forbid")

    simulations: int = Field(ge=0, le=256)


class Code(BaseModel):
    """A one-time code."""

    code: str


class Token(BaseModel):
    """A token."""

    token: str


def make_app(instances: Instances, keys: Keys) -> FastAPI:
    """The application, to be put behind `access.Access`.

    Args:
        instances: All runs, and what can be done with them.
        keys: What lets somebody in.
    """
    app = FastAPI(title="throwcollect", version=__version__, openapi_url="/openapi.json", docs_url=None, redoc_url=None)
    add_handlers(app)
    lookout = Lookout(instances.catalogue)
    watch = StateWatch(lookout.look)
    app.include_router(_general(watch, keys), prefix=PREFIX)
    app.include_router(_components(watch), prefix=PREFIX)
    app.include_router(_instances(instances, lookout), prefix=PREFIX)
    app.include_router(_views(instances), prefix=PREFIX)
    app.mount("/", StaticFiles(directory=_PAGE, html=True))
    return app


def _general(watch: StateWatch, keys: Keys) -> APIRouter:
    router = APIRouter()

    @router.get("/health")
    def health() -> dict[str, str]:
        """Whether it serves; for anybody."""
        return {"status": "ok", "version": __version__}

    @router.post("/codes", status_code=201)
    def make_code() -> Code:
        """A code that can be exchanged for the token once, for an address that is given to a browser."""
        return Code(code=keys.new_code())

    @router.post("/exchange", response_model=Token)
    def exchange(code: Code) -> Any:
        """The token for a code that nobody has exchanged yet; for anybody who has one."""
        token = keys.exchange(code.code)
        if token is None:
            return problem(403, "this code has been exchanged already, or is too old", hint="throwcollect view")
        return Token(token=token)

    @router.get("/state")
    async def state() -> State:
        """The state of everything."""
        return await watch.current()

    @router.websocket("/state")
    async def states(socket: WebSocket) -> None:
        await socket.accept()

        async def tell() -> None:
            async with aclosing(watch.states()) as found:  # type: ignore[type-var]
                async for text in found:
                    await socket.send_text(text.decode())

        await keep_telling(socket, tell)

    return router


def _components(watch: StateWatch) -> APIRouter:
    router = APIRouter(prefix="/components")

    @router.get("")
    async def components() -> list[ComponentState]:
        """All components."""
        return (await watch.current()).components

    @router.get("/{name}", response_model=ComponentState)
    async def component(name: str) -> Any:
        """A component."""
        found = [each for each in (await watch.current()).components if each.name == name]
        return found[0] if found else problem(404, f"no component {name!r}")

    return router


def _instances(instances: Instances, lookout: Lookout) -> APIRouter:
    router = APIRouter(prefix="/instances")

    @router.get("")
    def all_instances() -> list[InstanceState]:
        """All runs that this machine remembers, the latest first."""
        return lookout.list_instances()

    @router.get("/{instance}")
    def one(instance: str) -> InstanceState:
        """A run."""
        return describe(instances.get(instance))

    @router.put("/{instance}", status_code=202)
    def put(instance: str, wish: Wish, response: Response) -> InstanceState:
        """Begin an instance of a component; the same request again changes nothing."""
        run, new = instances.put(instance, Origin(wish.component, wish.simulations, wish.set))
        if not new:
            response.status_code = 200
        return describe(run)

    @router.post("", status_code=202)
    def post(wish: Wish, response: Response) -> InstanceState:
        """Begin an instance of a component, with an id that is chosen here."""
        made = f"{wish.component}-{time.time_ns() // 1_000_000:x}"
        run, _ = instances.put(made, Origin(wish.component, wish.simulations, wish.set))
        response.headers["Location"] = f"{PREFIX}/instances/{run.id}"
        return describe(run)

    @router.delete("/{instance}", status_code=202)
    def delete(instance: str, force: bool = False) -> None:
        """Stop a run: running trials are finished; by force, everything ends at once, and the run is forgotten."""
        instances.stop(instance, force=force)

    @router.patch("/{instance}", status_code=202)
    def patch(instance: str, scaling: Scaling) -> InstanceState:
        """Change the number of simulations of a run."""
        return describe(instances.scale(instance, scaling.simulations))

    @router.get("/{instance}/log/{node}", response_class=PlainTextResponse)
    def log(instance: str, node: str, tail: Annotated[int, Query(ge=1, le=10_000)] = 200) -> Any:
        """The last lines of what a node has printed."""
        logs = Path(instances.get(instance).record.logs)
        # Only what lies there is offered, so no name leads out of the directory.
        path = NodeLogs(logs).path(node) if f"{node}.log" in _names_in(logs) else None
        if path is None:
            return problem(404, f"run {instance} has no log of {node!r}", expected=", ".join(_names_in(logs)) or None)
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()[-tail:]
        return PlainTextResponse("".join(f"{line}\n" for line in lines))

    @router.get("/{instance}/events", response_class=Response)
    def events(instance: str) -> Response:
        """What has happened in a run, one event in JSON a line."""
        path = Path(instances.get(instance).record.logs) / EVENTS
        return Response(path.read_bytes() if path.exists() else b"", media_type="application/x-ndjson")

    return router


def _views(instances: Instances) -> APIRouter:
    router = APIRouter()
    watches: dict[str, ThrowWatch] = {}

    @router.get("/instances/{instance}/urdf", response_class=Response)
    def urdf(instance: str) -> Response:
        """The robot of a run, with its tool, in URDF; meshes are ``package://`` URLs."""
        return Response(description_of(instances.get(instance)), media_type="application/xml")

    @router.get("/meshes/{package}/{path:path}", response_class=FileResponse)
    def mesh(package: str, path: str) -> FileResponse:
        """The file of a mesh."""
        return FileResponse(find_mesh(package, path), headers={"Cache-Control": "private, max-age=86400"})

    @router.websocket("/instances/{instance}/shown")
    async def shown(socket: WebSocket, instance: str) -> None:
        try:
            run = await asyncio.to_thread(instances.get, instance)
        except ThrowcollectError:
            await socket.close(4404, f"no run {instance}")
            return
        await socket.accept()
        watch = watches.setdefault(instance, ThrowWatch(run))
        async with watch.throws() as next_throw:
            await keep_telling(socket, lambda: _send_next(socket, next_throw))

    return router


async def _send_next(socket: WebSocket, next_throw: Callable[[], Awaitable[bytes]]) -> None:
    while True:
        await socket.send_bytes(await next_throw())


def _names_in(logs: Path) -> list[str]:
    return sorted(path.name for path in logs.glob("*.log"))
