"""The sockets of rosbridge turn some clients away, with a code and a reason."""

from __future__ import annotations

from datetime import datetime, timezone

import pytest
from starlette.websockets import WebSocketDisconnect
from tests.unit.serve.conftest import Remember, Served

from throwcollect.serve import sockets


def end_of(served: Served, path: str) -> tuple[int, str]:
    """Close code and reason of a socket."""
    with served.socket(path, served.keys.full) as socket, pytest.raises(WebSocketDisconnect) as end:
        socket.receive_text()
    return end.value.code, end.value.reason


def test_a_client_without_a_living_run_is_turned_away_with_the_reason(served: Served) -> None:
    assert end_of(served, "/rosbridge/nope") == (4404, "no run nope")
    assert end_of(served, "/") == (4404, "no run lives; the path /rosbridge/RUN names one")


@pytest.mark.parametrize("path", ["/rosbridge/small", "/", "/api/v1/instances/small/shown"])
def test_a_client_is_told_when_its_run_ends_or_is_forgotten(
    path: str, served: Served, remember: Remember, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "_LOOK_S", 0.05)
    run = remember("small")
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
