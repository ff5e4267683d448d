"""The sockets of rosbridge turn some clients away, with a code and a reason."""

from __future__ import annotations

from contextlib import ExitStack
from datetime import datetime, timezone

import pytest
from starlette.websockets import WebSocketDisconnect
from tests.unit.serve.conftest import Remember, Served

from throwcollect.ros.router import router
from throwcollect.serve import rosbridge_routes


def end_of(served: Served, path: str) -> tuple[int, str]:
    """Close code and reason of a socket."""
    with served.socket(path, served.keys.full) as socket, pytest.raises(WebSocketDisconnect) as end:
        socket.receive_text()
    return end.value.code, end.value.reason


def test_a_client_without_a_living_run_is_turned_away_with_the_reason(served: Served) -> None:
    assert end_of(served, "/rosbridge/nope") == (4404, "no run nope")
    assert end_of(served, "/") == (4404, "no run lives; the path /rosbridge/RUN names one")


@pytest.mark.parametrize("path", ["/rosbridge/small", "/", "/api/v1/instances/small/shown"])
def test_a_socket_is_closed_with_the_reason_when_its_run_ends_or_is_forgotten(
    path: str, served: Served, remember: Remember, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosbridge_routes, "_LOOK_S", 0.05)
    with router("tcp/127.0.0.1:0") as endpoint:
        run = remember("small", endpoint=endpoint)
        with served.socket(path, served.keys.full) as socket:
            run.update(ended=datetime.now(timezone.utc), exit_code=0)
            with pytest.raises(WebSocketDisconnect) as end:
                socket.receive_text()
        assert (end.value.code, end.value.reason) == (4404, "run small has ended")
        run.update(ended=None, exit_code=None)
        with served.socket(path, served.keys.full) as socket:
            run.forget()
            with pytest.raises(WebSocketDisconnect) as end:
                socket.receive_text()
        assert (end.value.code, end.value.reason) == (4404, "no run small")


def test_a_client_connects_again_when_the_router_of_its_run_has_gone(served: Served, remember: Remember) -> None:
    run = remember("small")
    assert end_of(served, "/rosbridge/small") == (4503, "run small has no router yet; connect again")
    with ExitStack() as router_lives:
        run.update(endpoint=router_lives.enter_context(router("tcp/127.0.0.1:0")))
        with served.socket("/rosbridge/small", served.keys.full) as socket:
            socket.send_json({"op": "call_service", "id": "a", "service": "rosapi/get_time"})
            assert socket.receive_json()["id"] == "a"
            router_lives.close()
            with pytest.raises(WebSocketDisconnect) as end:
                socket.receive_text()
    assert (end.value.code, end.value.reason) == (4503, "the router of the run has gone; connect again")
    assert end_of(served, "/rosbridge/small") == (4503, "the router of the run does not answer")
    with router("tcp/127.0.0.1:0") as endpoint:
        run.update(endpoint=endpoint)
        with served.socket("/rosbridge/small", served.keys.full) as again:
            again.send_json({"op": "call_service", "id": "b", "service": "rosapi/get_time"})
            assert again.receive_json()["id"] == "b"
