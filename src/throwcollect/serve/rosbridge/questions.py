"""Services of nodes that are called for one client."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from throwcollect.errors import ConfigError
from throwcollect.serve.rosbridge.errands import READY_S, Errand, Errands
from throwcollect.serve.rosbridge.peer import Peer

_MOST = 1000
"""Questions of one client that may wait for an answer."""


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
        if len(self._open) >= _MOST:
            raise ConfigError(f"{service}: {_MOST} requests wait for an answer already")
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
