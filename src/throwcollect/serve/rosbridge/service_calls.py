"""Services that a client calls: those of nodes, and those that the bridge answers itself."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from throwcollect.errors import ConfigError
from throwcollect.ros.names import absolute_name, full_name
from throwcollect.ros.values import fill
from throwcollect.serve.rosbridge.codec import cbor_values, json_values
from throwcollect.serve.rosbridge.guarded import refuse_secrets
from throwcollect.serve.rosbridge.peer import Peer
from throwcollect.serve.rosbridge.request import Request

_READY_S = 5.0
_POLL_S = 0.02
_WATCH_S = 1.0
_MOST = 1000
"""Calls of one client that wait for an answer."""


class Call:
    """One call, which is answered once.

    Args:
        client: Who calls.
        request: What it asks.

    Attributes:
        given: Name of the service as the client has it.
        arguments: Fields of the service's request.

    Raises:
        ConfigError: If the request is malformed.
    """

    def __init__(self, client: Peer, request: Request) -> None:
        self._client = client
        self._id = request.id
        self._form = request.form()
        self.given = request.text("service")
        self.arguments: Any = request.any("args")
        self.is_open = True

    @property
    def is_binary(self) -> bool:
        """Whether the answer is CBOR."""
        return self._form.compression != "none"

    def reply(self, values: object) -> None:
        """Answer with the fields of the response."""
        self._answer(values, done=True)

    def fail(self, why: str) -> None:
        """Answer that the call has failed."""
        self._answer(why, done=False)

    def _answer(self, values: object, *, done: bool) -> None:
        if self.is_open:
            self.is_open = False
            fields = {"op": "service_response", "id": self._id, "service": self.given, "values": values, "result": done}
            self._client.answer(fields, self._form)


class ServiceCalls:
    """The calls of services of nodes that one client has under way.

    Args:
        client: The client.
    """

    def __init__(self, client: Peer) -> None:
        self._client = client
        self._open: list[Call] = []

    def call(self, call: Call, request: Request) -> None:
        """Call a service of a node.

        Args:
            call: What is to be answered.
            request: What the client asks.

        Raises:
            ConfigError: If there is no such service, or it cannot be called like this.
        """
        service = absolute_name(call.given)
        refuse_secrets(service, call.arguments)
        if len(self._open) >= _MOST:
            raise ConfigError(f"{service}: {_MOST} calls wait for an answer already")
        timeout_s = request.seconds_or("timeout", float("inf"))
        session = self._client.session
        client = session.service_client(service, self._type_of(service, request.text_or("type", "")))
        message = client.srv_type.Request()
        _fill_arguments(message, call.arguments)
        self._open.append(call)
        self._send_when_ready(call, client, message, time.monotonic() + min(_READY_S, timeout_s))
        if timeout_s < float("inf"):
            self._client.later(timeout_s, partial(self._end, call, f"{service}: no answer within {timeout_s:g} s"))

    def lose(self) -> None:
        """Know that the session is gone, and all that it had."""
        for call in list(self._open):
            self._end(call, f"{call.given}: the router of the run has gone")

    def restore(self) -> None:
        """Have everything again: calls are not made anew."""

    def close(self) -> None:
        """Wait for no answer any more."""
        for call in self._open:
            call.is_open = False
        self._open.clear()

    def _type_of(self, service: str, wanted: str) -> str:
        there = dict(self._client.session.node.get_service_names_and_types()).get(service, [])
        if not there:
            raise ConfigError(f"nobody offers a service {service}")
        name = full_name("srv", wanted)
        return name if name in there else there[0]

    def _send_when_ready(self, call: Call, client: Any, message: Any, deadline: float) -> None:
        if not call.is_open:
            return
        if client.service_is_ready():
            client.call_async(message).add_done_callback(partial(self._finish, call))
            self._watch(call, client)
        elif time.monotonic() < deadline:
            self._client.later(_POLL_S, partial(self._send_when_ready, call, client, message, deadline))
        else:
            self._end(call, f"{call.given}: nobody offers the service any more")

    def _watch(self, call: Call, client: Any) -> None:
        """Give a call up whose service has gone."""
        if not call.is_open:
            return
        if client.service_is_ready():
            self._client.later(_WATCH_S, partial(self._watch, call, client))
        else:
            self._end(call, f"{call.given}: the service has gone and has not answered")

    def _finish(self, call: Call, future: Any) -> None:
        if call.is_open:
            response = future.result()
            self._open.remove(call)
            call.reply(cbor_values(response) if call.is_binary else json_values(response))

    def _end(self, call: Call, why: str) -> None:
        if call.is_open:
            self._open.remove(call)
            call.fail(why)


def _fill_arguments(message: Any, arguments: object) -> None:
    """Set the fields of a request from a mapping, or from a list in their order.

    Raises:
        ConfigError: If they cannot have these values.
    """
    if isinstance(arguments, list):
        names = list(message.get_fields_and_field_types())
        if len(arguments) > len(names):
            raise ConfigError(f"{len(arguments)} arguments are too many", expected=f"at most {len(names)}")
        arguments = dict(zip(names, arguments, strict=False))
    fill(message, {} if arguments is None else arguments)
