"""The process of the server fails to start at an unusable address, and closes connections that only wait."""

from __future__ import annotations

import asyncio

import uvicorn
from starlette.responses import PlainTextResponse

from throwcollect.serve import server_process


async def is_closed(reader: asyncio.StreamReader, within_s: float) -> bool:
    """Whether the server closes a connection within this time, without an answer."""
    try:
        return await asyncio.wait_for(reader.read(), within_s) == b""
    except asyncio.TimeoutError:
        return False


async def open_connections(
    served: asyncio.Server, count: int
) -> list[tuple[asyncio.StreamReader, asyncio.StreamWriter]]:
    """Open connections one after the other; each sends only a part of its headers."""
    opened = []
    for _ in range(count):
        reader, writer = await asyncio.open_connection(*served.sockets[0].getsockname())
        writer.write(b"GET / HTTP/1.1\r\nHost: a\r\n")
        await asyncio.sleep(0.02)
        opened.append((reader, writer))
    return opened


async def serve_connections() -> asyncio.Server:
    """Serve one text by the connections of the server, whose next headers have to be whole within a second."""
    config = uvicorn.Config(PlainTextResponse("hello"), timeout_keep_alive=1, log_config=None)
    config.load()
    state = uvicorn.server.ServerState()
    make = lambda: server_process._Connection(config, state, {})  # noqa: E731
    return await asyncio.get_running_loop().create_server(make, "127.0.0.1", 0)


def test_a_connection_whose_headers_do_not_get_whole_is_closed() -> None:
    async def try_it() -> None:
        async with await serve_connections() as served:
            [(slow, sending), (whole, asking)] = await open_connections(served, 2)
            asking.write(b"\r\n")
            assert (await whole.readline()).startswith(b"HTTP/1.1 200")
            for _ in range(6):
                # Bytes of headers do not make the time longer.
                sending.write(b"A: b\r\n")
                await asyncio.sleep(0.1)
            assert not slow.at_eof()
            assert await is_closed(slow, 3)
            # The answered one waits for its next headers, of which it also gets only a part.
            asking.write(b"GET / HTTP/1.1\r\n")
            await asyncio.wait_for(whole.read(), 3)
            sending.close()
            asking.close()

    asyncio.run(try_it())
