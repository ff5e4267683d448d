"""Sockets that only send."""

from __future__ import annotations

import logging
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any

import pytest
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from throwcollect.serve.sockets import keep_telling


def end_of(speak: Callable[[WebSocket], Coroutine[Any, Any, None]]) -> tuple[int, str]:
    """Close code and reason of a socket on which a function sends."""

    async def tell(socket: WebSocket) -> None:
        await socket.accept()
        await keep_telling(socket, speak(socket))
        # A socket that nobody has closed would hold up the test for ever.
        with suppress(RuntimeError):
            await socket.close(4000, "left open")

    client = TestClient(Starlette(routes=[WebSocketRoute("/", tell)]))
    with client.websocket_connect("/") as socket, pytest.raises(WebSocketDisconnect) as end:
        socket.receive_text()
    return end.value.code, end.value.reason


def find_logged(caplog: pytest.LogCaptureFixture) -> list[BaseException | None]:
    """The errors that were logged with their traceback."""
    found = [each for each in caplog.records if each.name.startswith("throwcollect.serve")]
    assert all(each.levelno == logging.ERROR for each in found)
    return [each.exc_info[1] for each in found if each.exc_info]


def test_an_unexpected_error_closes_the_socket_and_gets_into_the_log(caplog: pytest.LogCaptureFixture) -> None:
    error = TypeError("a mistake")

    async def fail(_: WebSocket) -> None:
        raise error

    assert end_of(fail) == (1011, "internal error")
    assert find_logged(caplog) == [error]
