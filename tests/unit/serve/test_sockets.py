"""Sockets that only send, on the real server."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket
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
