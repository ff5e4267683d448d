"""Services of nodes that are called for one client, whose answers are waited for as long as there is hope."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from throwcollect.errors import ConfigError
from throwcollect.serve.rosbridge.peer import Peer

READY_S = 5.0
"""Time in which nodes find each other."""
POLL_S = 0.02
WATCH_S = 1.0
_MOST = 1000
"""Questions of one client that wait for an answer."""


class _Question:
    """A request to a service that has no answer yet."""

    def __init__(self, service: str, message: Any, failed: Callable[[str], None]) -> None:
        self.service = service
        self.message = message
        self.failed = failed
        self.is_open = True


class Questions:
    """All requests of one client to services that wait for an answer.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._open: list[_Question] = []

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
            timeout_s: Time after which it is given up [s].

        Raises:
            ConfigError: If there is no such type, or too many questions wait for an answer already.
        """
        if len(self._open) >= _MOST:
            raise ConfigError(f"{service}: {_MOST} requests wait for an answer already")
        client = self._client.session.service_client(service, type_name)
        question = _Question(service, message, failed)
        self._open.append(question)
        self._send_when_ready(question, client, answered, time.monotonic() + min(READY_S, timeout_s))
        if timeout_s < float("inf"):
            self._client.later(timeout_s, partial(self._end, question, f"no answer within {timeout_s:g} s"))

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        for question in list(self._open):
            self._end(question, "the router of the run has gone")

    def restore(self) -> None:
        """Have everything again: nothing is asked anew."""

    def close(self) -> None:
        """Wait for no answer any more."""
        for question in self._open:
            question.is_open = False
        self._open.clear()

    def _send_when_ready(
        self, question: _Question, client: Any, answered: Callable[[Any], None], deadline: float
    ) -> None:
        if not question.is_open:
            return
        if client.service_is_ready():
            try:
                future = client.call_async(question.message)
            except (TypeError, ValueError) as error:
                self._end(question, str(error))
                return
            future.add_done_callback(partial(self._finish, question, answered))
            self._watch(question, client)
        elif time.monotonic() < deadline:
            self._client.later(POLL_S, partial(self._send_when_ready, question, client, answered, deadline))
        else:
            self._end(question, "nobody offers the service")

    def _watch(self, question: _Question, client: Any) -> None:
        """Give a question up whose service has gone."""
        if not question.is_open:
            return
        if client.service_is_ready():
            self._client.later(WATCH_S, partial(self._watch, question, client))
        else:
            self._end(question, "the service has gone and has not answered")

    def _finish(self, question: _Question, answered: Callable[[Any], None], future: Any) -> None:
        if question.is_open:
            question.is_open = False
            self._open.remove(question)
            answered(future.result())

    def _end(self, question: _Question, why: str) -> None:
        if question.is_open:
            question.is_open = False
            self._open.remove(question)
            question.failed(f"{question.service}: {why}")
