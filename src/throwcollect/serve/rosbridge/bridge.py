"""A bridge connects all clients of one run to its ROS graph, in a thread of its own."""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from throwcollect import ros
from throwcollect.errors import ThrowcollectError
from throwcollect.ros.connection import Connection
from throwcollect.ros.router_endpoint import answers
from throwcollect.serve.rosbridge.bridge_client import BridgeClient
from throwcollect.serve.rosbridge.bridge_session import BridgeSession
from throwcollect.serve.rosbridge.codec import Frame
from throwcollect.serve.rosbridge.offers import FAREWELL_S
from throwcollect.serve.rosbridge.peer import Peer

_logger = logging.getLogger(__name__)

_LOOK_S = 1.0
"""Time between two looks at the router and at the quality of service that publishers offer."""
_RETRY_S = 0.2
_MISSES = 2
"""After this many looks without an answer, the router counts as gone; on a busy machine, one answer may be late."""


class Bridge:
    """Takes part in the ROS graph of one run for any number of clients.

    Several bridges may live in one process, each in another run. On Fast DDS a process is in one run at a time.

    Args:
        connection: The way into the run; None if its router has no address yet, which `move` then sets.
    """

    def __init__(self, connection: Connection | None) -> None:
        self._connection = connection
        self._session: BridgeSession | None = None
        self._joined: Connection | None = None
        self._clients: list[BridgeClient] = []
        # This outlives a session, as the offers of clients do.
        self.offered: set[str] = set()
        self._work: SimpleQueue[Callable[[], None]] = SimpleQueue()
        # The number orders timers of equal time, because functions cannot be compared.
        self._timers: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._looked_at = 0.0
        self._misses = 0
        self._thread = threading.Thread(target=self._run, name="rosbridge", daemon=True)
        self._thread.start()

    def attach(self, send: Callable[[Frame], None], *, read_only: bool = False) -> BridgeClient:
        """Add a client, which the caller has to close.

        The bridge's thread calls ``send`` with each frame for the client, so ``send`` may neither wait nor fail.
        """
        client = BridgeClient(self, send, read_only=read_only)
        self.submit(lambda: self._clients.append(client))
        return client

    def move(self, connection: Connection | None) -> None:
        """Use another way into the run, whose router has another address; None while the router has no address."""
        self._connection = connection
        self.submit(_do_nothing)

    def close(self) -> None:
        """End the bridge, and withdraw all that its clients have."""
        self._closing.set()
        self.submit(_do_nothing)
        self._thread.join()

    @property
    def is_connected(self) -> bool:
        """Whether the bridge is in the graph of its run by now."""
        return self._session is not None

    @property
    def session(self) -> BridgeSession:
        """The place in the ROS graph; only for the bridge's thread."""
        if self._session is None:
            raise ThrowcollectError("the router of the run does not answer")
        return self._session

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Call an action after a time [s]; only for the bridge's thread."""
        heapq.heappush(self._timers, (time.monotonic() + seconds, next(self._numbers), action))

    def submit(self, action: Callable[[], None]) -> None:
        """Call an action soon, in the bridge's thread."""
        self._work.put(action)
        with self._lock:
            if self._session is not None:
                # During a session, the thread waits in the executor, and only a task wakes it.
                self._session.executor.create_task(self._do_next)

    def forget(self, client: Peer) -> None:
        """Take a client off the list."""
        self._clients = [each for each in self._clients if each is not client]

    def _run(self) -> None:
        while not self._closing.is_set():
            self._attempt(self._look)
            self._call_timers()
            wait_s = min(self._timers[0][0] - time.monotonic(), _LOOK_S) if self._timers else _LOOK_S
            if self._session is not None:
                self._spin(self._session, max(wait_s, 0.0))
            else:
                # With a time of 0, `_do_next` would not wait, and this loop would use a whole core.
                self._do_next(max(min(wait_s, _RETRY_S), 0.001))
        for client in list(self._clients):
            client.close()
        while not self._work.empty():
            self._do_next()
        # Timers withdraw the actions of clients a bit later, so that nodes get the last results before.
        end = time.monotonic() + FAREWELL_S
        while self._session is not None and self._timers and self._timers[0][0] <= end:
            self._spin(self._session, max(self._timers[0][0] - time.monotonic(), 0.0))
            self._call_timers()
        self._leave()

    def _spin(self, session: BridgeSession, seconds: float) -> None:
        try:
            self._attempt(lambda: session.executor.spin_once(timeout_sec=seconds))
        except ros.ExternalShutdownException:
            # Something has shut down all contexts of this process.
            self._lose()

    def _do_next(self, seconds: float = 0.0) -> None:
        try:
            action = self._work.get(timeout=seconds) if seconds else self._work.get_nowait()
        except Empty:
            return
        self._attempt(action)

    def _attempt(self, action: Callable[[], None]) -> None:
        try:
            action()
        except ros.ExternalShutdownException:
            raise
        except Exception:
            # A failing action must not end this thread, which serves all clients.
            _logger.exception("an action of the bridge failed")

    def _call_timers(self) -> None:
        while self._timers and self._timers[0][0] <= time.monotonic():
            self._attempt(heapq.heappop(self._timers)[2])

    def _look(self) -> None:
        """Join the run if its router answers, and notice when the router no longer answers."""
        now = time.monotonic()
        wait_s = _LOOK_S if self._session is not None else _RETRY_S
        if now < self._looked_at + wait_s and self._joined == self._connection:
            return
        self._looked_at = now
        connection = self._connection
        has_answered = connection is not None and answers(connection.endpoint)
        self._misses = 0 if has_answered else self._misses + 1
        if self._session is not None and (self._misses >= _MISSES or connection != self._joined):
            self._lose()
        if self._session is None and connection is not None and has_answered:
            self._join(connection)
        if self._session is not None:
            self._session.look_around()

    def _join(self, connection: Connection) -> None:
        try:
            session = BridgeSession(connection)
        except ThrowcollectError as error:
            _logger.warning("the bridge cannot join the run: %s", error)
            return
        with self._lock:
            self._session = session
        self._joined = connection
        for client in self._clients:
            client.restore()
        # Actions that were submitted while there was no session have no task in its executor, so they are done here.
        while not self._work.empty():
            self._do_next()

    def _lose(self) -> None:
        for client in self._clients:
            client.lose()
        self._leave()

    def _leave(self) -> None:
        with self._lock:
            session, self._session = self._session, None
        self._joined = None
        if session is not None:
            self._attempt(session.close)


def _do_nothing() -> None:
    """Work that only wakes the bridge."""
