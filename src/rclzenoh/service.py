"""Services and their clients."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any

import zenoh

from rclzenoh.endpoint import Attachment, Endpoint, unpack
from rclzenoh.exceptions import InvalidHandle
from rclzenoh.interfaces import Message, deserialize, serialize
from rclzenoh.interfaces import Service as ServiceType
from rclzenoh.keys import EntityKind
from rclzenoh.mailbox import Receiver
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile, qos_profile_services_default
from rclzenoh.task import Future, call

_PATIENT_SERVICE = "/_action/get_result"
_ENDLESS_S = 1e9
"""Timeout of requests that may last as long as an action."""

Callback = Callable[[Any, Any], Any]


class Service(Endpoint, Receiver):
    """Answers requests. Made by `Node.create_service`.

    While a callback that is a coroutine function waits, other callbacks are called.
    """

    def __init__(
        self, node: NodeBase, srv_type: type[ServiceType], srv_name: str, callback: Callback, qos_profile: QoSProfile
    ) -> None:
        Endpoint.__init__(self, node, EntityKind.SERVICE, srv_name, srv_type.TYPE, qos_profile)
        # The queue has no limit, whatever is announced: clients would wait for ever for an answer to a dropped request.
        Receiver.__init__(self, node.mailbox, None)
        self.service_name = self.name
        self.srv_type = srv_type
        self.callback = callback
        self._open: set[zenoh.Query] = set()
        handler = zenoh.handlers.Callback(self.deliver, indirect=False)
        # It is declared complete because clients of rmw_zenoh_cpp ask only complete queryables.
        self.announce(self.session.declare_queryable(self.key, handler, complete=True))

    def handle(self, item: zenoh.Query) -> None:
        """Decode a request, call back, and answer when the response is there."""
        try:
            self.check_key(item.encoding)
            attachment = unpack(item.attachment)
            payload = item.payload.to_bytes() if item.payload is not None else b""
            request = deserialize(payload, self.srv_type.Request)
        except ValueError as error:
            self.complain(error)
            # Clients log the error. If the client has ended, or the session is being closed, it cannot be sent.
            with suppress(zenoh.ZError):
                item.reply_err(str(error))
            item.drop()  # type: ignore[no-untyped-call]
            return
        self._open.add(item)
        call(self.mailbox, self._serve, item, attachment, request)

    async def _serve(self, query: zenoh.Query, received: Attachment, request: Message) -> None:
        try:
            response = self.callback(request, self.srv_type.Response())
            if inspect.iscoroutine(response):
                response = await response
            if not isinstance(response, self.srv_type.Response):
                raise TypeError(
                    f"{self.service_name}: the callback must return {self.srv_type.TYPE}.Response, got {response!r:.80}"
                )
            payload = serialize(response)
            attachment = Attachment(received.sequence, time.time_ns(), received.gid).pack()
            if self.declared is not None:
                try:
                    query.reply(self.key, payload, attachment=attachment)
                except zenoh.ZError as error:
                    self.complain(f"a response could not be sent, the client may be gone: {error}")
        finally:
            # The query is dropped, because otherwise it would stay open at the client until its timeout.
            self._open.discard(query)
            query.drop()  # type: ignore[no-untyped-call]

    def destroy(self) -> None:
        """Withdraw the service; requests without an answer get none. See `Node.destroy_service`."""
        super().destroy()
        for query in [*self.take_all(), *self._open]:
            query.drop()
        self._open.clear()


class Client(Endpoint, Receiver):
    """Calls a service. Made by `Node.create_client`."""

    def __init__(self, node: NodeBase, srv_type: type[ServiceType], srv_name: str) -> None:
        Endpoint.__init__(self, node, EntityKind.CLIENT, srv_name, srv_type.TYPE, qos_profile_services_default)
        # There is at most one response per request, and a dropped one would be waited for in vain.
        Receiver.__init__(self, node.mailbox, None)
        self.service_name = self.name
        self.srv_type = srv_type
        self._pending: dict[int, tuple[Future, Callable[[Any], Any]]] = {}
        self._numbers = count(1)
        # As in rmw_zenoh_cpp, every complete queryable of this key is asked, and Zenoh must not merge or drop replies.
        querier = self.session.declare_querier(
            self.key,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=_ENDLESS_S if self.service_name.endswith(_PATIENT_SERVICE) else None,
        )
        # Zenoh knows whether a querier has a queryable, so the graph need not be asked for services of all nodes.
        handler = zenoh.handlers.Callback(node.context.graph.note_change, indirect=False)
        querier.declare_matching_listener(handler)
        self._was_asked = False
        self.announce(querier)

    def service_is_ready(self) -> bool:
        """Whether a node offers the service."""
        querier = self.declared
        if querier is not None and not (self._was_asked or querier.matching_status.matching):
            self._was_asked = True
            self.node.context.graph.catch_up()
        return querier is not None and bool(querier.matching_status.matching)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Wait until a node offers the service, and return whether one does; see `Graph.wait_for`."""
        return self.node.context.graph.wait_for(self.service_is_ready, timeout_sec)

    def call_async(self, request: Message, convert: Callable[[Any], Any] = lambda response: response) -> Future:
        """Send a request; the future of the response stays pending if no service answers.

        The result of the future is what ``convert`` makes of the response, by default the response itself.
        """
        if not isinstance(request, self.srv_type.Request):
            raise TypeError(f"{self.service_name}: expected {self.srv_type.TYPE}.Request, got {type(request).__name__}")
        payload, future, sequence = serialize(request), Future(), next(self._numbers)
        # Another thread may destroy the client meanwhile.
        if (querier := self.declared) is None:
            raise InvalidHandle(f"{self.service_name}: the client was destroyed")
        # The future is noted before the request is sent, because the thread that spins may get the response at once.
        self._pending[sequence] = future, convert
        # Zenoh drops the handler after the last reply, which puts the number into the queue after all replies.
        handler = zenoh.handlers.Callback(self.deliver, drop=lambda: self.deliver(sequence), indirect=False)
        attachment = Attachment(sequence, time.time_ns(), self.gid).pack()
        try:
            querier.get(handler, payload=payload, encoding=self.encoding, attachment=attachment)
        except zenoh.ZError as error:
            del self._pending[sequence]
            raise self.invalid(error) from error
        return future

    def handle(self, item: zenoh.Reply | int) -> None:
        """Decode a response and complete its future; a number means that its request gets no further response."""
        if isinstance(item, int):
            self._pending.pop(item, None)
            return
        sample = item.ok
        if sample is None:
            self.complain(f"the service answered with an error: {item.err and item.err.payload.to_bytes()!r}")
            return
        try:
            attachment = unpack(sample.attachment)
            response = deserialize(sample.payload.to_bytes(), self.srv_type.Response)
        except ValueError as error:
            self.complain(error)
            return
        # Numbers of requests are mixed up, too, while a lost link is replaced (`Endpoint.check_key`).
        if attachment.gid != self.gid or attachment.sequence not in self._pending:
            self.complain("unexpected response; there may be more than one server of this name")
            return
        future, convert = self._pending.pop(attachment.sequence)
        future.set_result(convert(response))

    def destroy(self) -> None:
        """Withdraw the client; pending futures stay pending. See `Node.destroy_client`."""
        super().destroy()
        self._pending.clear()
        self.take_all()
