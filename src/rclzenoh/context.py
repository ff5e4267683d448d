"""Contexts: the life of a Zenoh session, and the shutdown of all that uses it."""

from __future__ import annotations

import atexit
import time
import weakref
from contextlib import suppress
from functools import cache
from itertools import count
from typing import Any

import zenoh

from rclzenoh.exceptions import NoRouterError, NotInitializedException
from rclzenoh.graph import Graph
from rclzenoh.session_config import describe, domain_of_environment, environment_config

_open: weakref.WeakSet[Context] = weakref.WeakSet()
_PATIENCE_S, _RETRY_S = 5.0, 0.1
_ARRIVAL_S = 1.0
"""Longest time for which a subscriber that reads nothing can delay the end of a session."""


class Context:
    """One Zenoh session, from `init` to `shutdown`.

    Attributes:
        executors: Executors that are woken when the context shuts down.
    """

    def __init__(self) -> None:
        self.executors: weakref.WeakSet[Any] = weakref.WeakSet()
        self._graph: Graph | None = None
        self._ids = count()
        self._domain_id = 0

    def init(self, *, domain_id: int | None = None, config: zenoh.Config | None = None) -> None:
        """Open the session.

        Args:
            domain_id: Domain identifier; None takes ``ROS_DOMAIN_ID``, or 0.
            config: Configuration of the session; None makes it from the environment.
        """
        if self.ok():
            raise RuntimeError("the context has been initialised already")
        self._domain_id = domain_of_environment() if domain_id is None else domain_id
        session = open_session(environment_config() if config is None else config)
        self._graph = Graph(session, self._domain_id)
        self._ids = count()
        _open.add(self)

    def ok(self) -> bool:
        """Whether the context can be used."""
        return self._graph is not None

    @property
    def graph(self) -> Graph:
        """The ROS graph."""
        if self._graph is None:
            raise NotInitializedException("init() has not been called, or shutdown() has")
        return self._graph

    @property
    def session(self) -> zenoh.Session:
        """The session."""
        return self.graph.session

    def get_domain_id(self) -> int:
        """Domain identifier."""
        return self._domain_id

    def next_id(self) -> int:
        """A number that no node or endpoint of the session has yet."""
        return next(self._ids)

    def shutdown(self) -> None:
        """End all spinning and close the session."""
        if not self.ok():
            raise RuntimeError("the context has not been initialised, or was shut down already")
        self.try_shutdown()

    def try_shutdown(self) -> None:
        """Like `shutdown`, but does nothing if there is nothing to shut down."""
        graph, self._graph = self._graph, None
        for executor in list(self.executors):
            executor.wake()
        _open.discard(self)
        if graph is not None:
            try:
                _let_messages_arrive(graph.session, self._domain_id)
            finally:
                graph.session.close()  # type: ignore[no-untyped-call]


def open_session(config: zenoh.Config) -> zenoh.Session:
    """Open a session with a router, which may just be starting; the caller has to close it.

    Zenoh itself waits for a router only if the configuration has ``connect/timeout_ms``, which it lacks by default.
    """
    zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]
    begin = time.monotonic()
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            waited = time.monotonic() - begin
            if waited > _PATIENCE_S:
                raise NoRouterError(config.get_json("connect/endpoints"), round(waited, 1), describe(error)) from error
            time.sleep(_RETRY_S)


def _let_messages_arrive(session: zenoh.Session, domain_id: int) -> None:
    """Wait until the router has read all messages that were sent, for a second at most.

    When a session closes, Zenoh 1.10 breaks off the message that it is writing, and then writes the messages that
    withdraw tokens, whose bytes a subscriber takes for the end of the broken message. The router reads a query after
    all messages that were sent before it, and answers this query itself, as no other process has its key.
    """
    with suppress(zenoh.ZError):
        list(session.get(f"{domain_id}/@arrived", timeout=_ARRIVAL_S))


@cache
def get_default_context() -> Context:
    """The context that is used when none is given."""
    return Context()


def init(*, context: Context | None = None, domain_id: int | None = None, config: zenoh.Config | None = None) -> None:
    """Initialise a context as `Context.init` does, the default one if none is given."""
    (context or get_default_context()).init(domain_id=domain_id, config=config)


def shutdown(*, context: Context | None = None) -> None:
    """Shut a context down, the default one if none is given."""
    (context or get_default_context()).shutdown()


@atexit.register
def _close_all() -> None:
    for context in list(_open):
        context.try_shutdown()
