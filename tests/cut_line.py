"""A connection that a test can cut, as if the other side went away."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress

Address = str | tuple[str, int]
"""Path of a socket, or host and port."""


class CutLine:
    """A socket that forwards to another one until it is cut.

    Args:
        address: Where the socket is made.
        target: Where it forwards to.

    Attributes:
        address: Where it was made; a port 0 has become a free one.
    """

    def __init__(self, address: Address, target: Address) -> None:
        self._target = target
        self._ends: list[socket.socket] = []
        self._flows = threading.Event()
        self._flows.set()
        self._server = _make_socket(address)
        self._server.bind(address)
        self._server.listen(64)
        self.address: Address = self._server.getsockname()
        threading.Thread(target=self._accept, daemon=True).start()

    def interrupt(self) -> None:
        """Break all connections; new ones are possible."""
        ends, self._ends = self._ends, []
        for end in ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def clog(self) -> None:
        """Stop forwarding data, while the connections stay open."""
        self._flows.clear()

    def cut(self) -> None:
        """Break all connections for good."""
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.interrupt()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._server.accept()
                far = _make_socket(self._target)
                far.connect(self._target)
                self._ends += [near, far]
                for source, sink in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(source, sink), daemon=True).start()

    def _forward(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                self._flows.wait()
                sink.sendall(data)
        with suppress(OSError):
            sink.shutdown(socket.SHUT_WR)


def _make_socket(address: Address) -> socket.socket:
    return socket.socket(socket.AF_UNIX if isinstance(address, str) else socket.AF_INET)
