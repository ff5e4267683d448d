"""Services."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from typing import Any

import zenoh

from rclzenoh.endpoint import Attachment, Endpoint, unpack
from rclzenoh.interfaces import Message, deserialize, serialize
from rclzenoh.interfaces import Service as ServiceType
from rclzenoh.keys import EntityKind
from rclzenoh.mailbox import Receiver
from rclzenoh.node_base import NodeBase
from rclzenoh.qos import QoSProfile
from rclzenoh.task import start

Callback = Callable[[Any, Any], Any]


class Service(Receiver):
    """Answers requests. Made by `Node.create_service`.

    While a callback that is a coroutine function waits, other callbacks are called.
    """

    def __init__(
        self, node: NodeBase, srv_type: type[ServiceType], srv_name: str, callback: Callback, qos_profile: QoSProfile
    ) -> None:
        super().__init__(node.mailbox, qos_profile.queue_length)
        self.srv_type = srv_type
        self.qos_profile = qos_profile
        self.callback = callback
        self._open: set[zenoh.Query] = set()
        self._is_destroyed = False
        self._endpoint = Endpoint(node, EntityKind.SERVICE, srv_name, srv_type.TYPE, qos_profile)
        handler = zenoh.handlers.Callback(self.deliver, indirect=False)
        # It is declared complete because clients of rmw_zenoh_cpp ask only complete queryables.
        queryable = self._endpoint.session.declare_queryable(self._endpoint.key, handler, complete=True)
        self._endpoint.announce(queryable)

    @property
    def service_name(self) -> str:
        """Absolute name of the service."""
        return self._endpoint.name

    def handle(self, item: zenoh.Query) -> None:
        """Decode a request, call back, and answer when the response is there."""
        try:
            self._endpoint.check_key(item.encoding)
            attachment = unpack(item.attachment.to_bytes() if item.attachment is not None else b"")
            payload = item.payload.to_bytes() if item.payload is not None else b""
            request = deserialize(payload, self.srv_type.Request)
        except ValueError as error:
            self._endpoint.complain(error)
            _refuse(item, str(error))
            return
        self._open.add(item)
        start(self.mailbox, self._serve(item, attachment, request))

    def refuse(self, item: zenoh.Query, reason: str) -> None:  # noqa: D102 - see `Receiver`
        _refuse(item, f"{self.service_name}: {reason}")

    async def _serve(self, query: zenoh.Query, received: Attachment, request: Message) -> None:
        try:
            response = self.callback(request, self.srv_type.Response())
            if inspect.iscoroutine(response):
                response = await response
            if not isinstance(response, self.srv_type.Response):
                raise TypeError(
                    f"{self.service_name}: the callback must return {self.srv_type.TYPE}.Response, got {response!r:.80}"
                )
            self._reply(query, received, response)
        finally:
            # The query is dropped, because otherwise it would stay open at the client until its timeout.
            self._open.discard(query)
            query.drop()  # type: ignore[no-untyped-call]

    def _reply(self, query: zenoh.Query, received: Attachment, response: Message) -> None:
        attachment = Attachment(received.sequence, time.time_ns(), received.gid).pack()
        if self._is_destroyed:
            return
        try:
            query.reply(self._endpoint.key, serialize(response), attachment=attachment)
        except zenoh.ZError as error:
            self._endpoint.complain(f"a response could not be sent, the client may be gone: {error}")

    def destroy(self) -> None:
        """Withdraw the service; requests without an answer get none. See `Node.destroy_service`."""
        # This is set first, because the thread that spins may be about to answer a request.
        self._is_destroyed = True
        self._endpoint.close()
        self.discard_all()
        for query in list(self._open):
            query.drop()  # type: ignore[no-untyped-call]
        self._open.clear()


def _refuse(query: zenoh.Query, reason: str) -> None:
    """Answer with an error, which clients log, and close the query."""
    try:
        query.reply_err(reason)
    except zenoh.ZError:
        return  # The client has ended, or the session is being closed.
    finally:
        query.drop()  # type: ignore[no-untyped-call]
