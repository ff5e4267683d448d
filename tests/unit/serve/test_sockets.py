"""Sockets that only send."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.sync.client import connect

from throwcollect.serve.server_process import WEBSOCKETS
from throwcollect.serve.sockets import keep_telling

FRAME = bytes(2**20)


@dataclass
class Teller:
    """Sends the same frame to each client again and again, and counts the sent frames by client."""

    told: list[int] = field(default_factory=list)
    url: str = ""

    async def tell(self, socket: WebSocket) -> None:
        number = len(self.told)
        self.told.append(0)
        await socket.accept()

        async def speak() -> None:
            while True:
                await socket.send_bytes(FRAME)
                self.told[number] += 1
                await asyncio.sleep(0)

        await keep_telling(socket, speak())


@pytest.fixture
def teller() -> Iterator[Teller]:
    teller = Teller()
    app = Starlette(routes=[WebSocketRoute("/", teller.tell)])
    config = uvicorn.Config(
        app, port=0, log_level="warning", lifespan="off", ws=WEBSOCKETS, ws_per_message_deflate=False
    )
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    deadline = time.monotonic() + 20
    while not server.started:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    teller.url = f"ws://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}/"
    yield teller
    server.should_exit = True
    thread.join(20)


def test_a_client_that_never_reads_does_not_block_others(teller: Teller) -> None:
    # Nobody reads the rest of the frames, for which closing would wait ten seconds.
    with (
        connect(teller.url, max_queue=1, max_size=None, close_timeout=0.1),
        connect(teller.url, max_size=None, close_timeout=0.1) as quick,
    ):
        for _ in range(200):
            assert quick.recv(timeout=20) == FRAME
        # A stalled client gets only as many frames as the buffers of connection and kernel hold.
        stalled, reading = teller.told
        assert stalled < 30 < reading
        time.sleep(0.5)
        assert teller.told[0] == stalled


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
