"""Requests of one client to services and actions of nodes, each until it is answered or cannot be answered any more."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

from throwcollect.serve.rosbridge.peer import Peer

READY_S = 5.0
"""Time in which nodes find each other."""
_POLL_S = 0.02
_WATCH_S = 1.0


class Errand:
    """One request of a client to a node; it ends once.

    Attributes:
        name: Absolute name of the service or action.
        fail: Tells the client why there is no answer.
        is_open: Whether the errand has not ended yet.
    """

    def __init__(self, name: str, fail: Callable[[str], None]) -> None:
        self.name = name
        self.fail = fail
        self.is_open = True


AnErrand = TypeVar("AnErrand", bound=Errand)


class Errands(Generic[AnErrand]):
    """All errands of one kind that a client waits for.

    Args:
        client: The client.
        unoffered: Sentence, with a place for the name, that says that no node offers the service or action.
        gone: Sentence, with a place for the name, that says that the node has ended before it answered.
    """

    def __init__(self, client: Peer, unoffered: str, gone: str) -> None:
        self._client = client
        self._unoffered = unoffered
        self._gone = gone
        self._open: list[AnErrand] = []

    def begin(
        self, errand: AnErrand, is_ready: Callable[[], bool], send: Callable[[], object], patience_s: float = READY_S
    ) -> None:
        """Send a request as soon as the node is found, and check from then on whether the node still exists.

        Args:
            errand: The request.
            is_ready: Returns whether a node offers the service or action.
            send: Sends the request; may raise `TypeError` or `ValueError` if the request is malformed.
            patience_s: Time within which the node has to be found [s].
        """
        self._open.append(errand)
        self._send_when_ready(errand, is_ready, send, time.monotonic() + patience_s)

    def end(self, errand: AnErrand) -> bool:
        """Take an errand off the list; returns whether it was still open."""
        was_open, errand.is_open = errand.is_open, False
        if was_open:
            self._open.remove(errand)
        return was_open

    def fail(self, errand: AnErrand, why: str) -> None:
        """End an errand without an answer, unless it has ended already."""
        if self.end(errand):
            errand.fail(why)

    def lose(self) -> None:
        """Fail all errands, because the session has ended."""
        for errand in list(self._open):
            self.fail(errand, f"{errand.name}: the router of the run has gone")

    def restore(self) -> None:
        """Do nothing in a new session: `lose` has told the client that its requests failed."""

    def close(self) -> None:
        """Stop waiting for answers; nodes go on with what they have begun."""
        for errand in list(self._open):
            self.end(errand)

    def _send_when_ready(
        self, errand: AnErrand, is_ready: Callable[[], bool], send: Callable[[], object], deadline: float
    ) -> None:
        if not errand.is_open:
            return
        if is_ready():
            try:
                send()
            except (TypeError, ValueError) as error:
                self.fail(errand, f"{errand.name}: {error}")
            self._watch(errand, is_ready)
        elif time.monotonic() < deadline:
            self._client.host.later(_POLL_S, partial(self._send_when_ready, errand, is_ready, send, deadline))
        else:
            self.fail(errand, self._unoffered.format(errand.name))

    def _watch(self, errand: AnErrand, is_ready: Callable[[], bool]) -> None:
        """Fail an errand whose service or action has gone."""
        if not errand.is_open:
            return
        if is_ready():
            self._client.host.later(_WATCH_S, partial(self._watch, errand, is_ready))
        else:
            self.fail(errand, self._gone.format(errand.name))


class Questions(Errands[Errand]):
    """All requests of one client to services that wait for an answer."""

    def __init__(self, client: Peer) -> None:
        super().__init__(client, "{}: nobody offers the service", "{}: the service has gone without an answer")

    def ask(
        self,
        service: str,
        type_name: str,
        message: Any,
        answered: Callable[[Any], None],
        failed: Callable[[str], None],
        timeout_s: float = float("inf"),
    ) -> None:
        """Call a service.

        Args:
            service: Its absolute name.
            type_name: Full name of its type.
            message: The request.
            answered: Called with the response.
            failed: Called with a sentence if there will be none.
            timeout_s: Time after which the call fails [s].
        """
        client = self._client.host.session.service_client(service, type_name)
        question = Errand(service, failed)

        def finish(future: Any) -> None:
            if self.end(question):
                answered(future.result())

        def send() -> None:
            client.call_async(message).add_done_callback(finish)

        self.begin(question, client.service_is_ready, send, min(READY_S, timeout_s))
        if timeout_s < float("inf"):
            late = f"{service}: no answer within {timeout_s:g} s"
            self._client.host.later(timeout_s, partial(self.fail, question, late))
