"""The application: REST, the socket of the state, and the page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Body, FastAPI, HTTPException, WebSocket
from fastapi.staticfiles import StaticFiles

from throwcollect.serve.access import Keys
from throwcollect.serve.dataset_routes import make_dataset_routes
from throwcollect.serve.instance_routes import make_instance_routes, make_log_routes
from throwcollect.serve.instances import Instances
from throwcollect.serve.live import restore_speeds_meanwhile
from throwcollect.serve.models import make_model_routes
from throwcollect.serve.problem_responses import DESCRIPTION, HANDLERS
from throwcollect.serve.rosbridge_routes import Bridges, make_rosbridge_routes
from throwcollect.serve.sensor_routes import make_live_sensor_routes, make_sensor_routes
from throwcollect.serve.sockets import keep_sending, send_all
from throwcollect.serve.state import STATES, ComponentState, States, WholeState
from throwcollect.serve.throw_routes import make_throw_routes
from throwcollect.serve.view_routes import make_view_routes
from throwcollect.version import __version__

PREFIX = "/api/v1"
_PAGE = Path(__file__).parent / "page"


def make_app(instances: Instances, models: Path, keys: Keys) -> FastAPI:
    """Make the application, which belongs behind `access.Access`."""
    app = FastAPI(
        title="throwcollect",
        lifespan=restore_speeds_meanwhile,
        version=__version__,
        docs_url=None,
        redoc_url=None,
        exception_handlers=HANDLERS,
    )
    states, bridges = States(instances.catalogue), Bridges()
    for routes in (
        _make_general_routes(states, keys),
        make_instance_routes(instances, states),
        make_log_routes(instances),
        make_dataset_routes(instances),
        make_throw_routes(instances),
        make_sensor_routes(instances),
        make_live_sensor_routes(instances),
        make_view_routes(instances, bridges),
        make_model_routes(models),
    ):
        app.include_router(routes, prefix=PREFIX, responses=DESCRIPTION)
    app.include_router(make_rosbridge_routes(instances, bridges))
    # Routes are tried in their order, and this last one takes all other paths.
    app.mount("/", StaticFiles(directory=_PAGE, html=True))
    return app


def _make_general_routes(states: States, keys: Keys) -> APIRouter:
    router = APIRouter()

    @router.get("/health")
    def health() -> dict[str, str]:
        """Whether it serves; for all clients."""
        return {"status": "ok", "version": __version__}

    @router.post("/exchange")
    def exchange(code: Annotated[str, Body(embed=True)]) -> dict[str, str]:
        """The token for a code that was not exchanged before; for all clients."""
        if (token := keys.exchange(code)) is None:
            raise HTTPException(
                403, "this code has been exchanged already, or is too old; throwcollect view makes another"
            )
        return {"token": token}

    @router.post("/codes", status_code=201)
    def make_code() -> dict[str, str]:
        """A code that can be exchanged for the token once, for an address that is given to a browser."""
        return {"code": keys.new_code()}

    @router.get("/state")
    async def state() -> WholeState:
        """The state of everything."""
        return await states.read()

    @router.get("/components")
    async def components() -> list[ComponentState]:
        """All components."""
        return (await states.read()).components

    @router.websocket("/state")
    async def follow(socket: WebSocket) -> None:
        await socket.accept()
        frames = (STATES.dump_json(each).decode() async for each in states.follow())
        await keep_sending(socket, send_all(socket, frames))

    return router
