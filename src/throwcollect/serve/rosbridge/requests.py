"""Reads the frames of one client, and has each operation carried out."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.rosbridge.advertised import Advertised
from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.calls import Call, Goals, call_node
from throwcollect.serve.rosbridge.client import Client
from throwcollect.serve.rosbridge.codec import Frame, Reassembly, read_frame
from throwcollect.serve.rosbridge.operations import MAY_READ, CallService, Fragment, Status, read_operation
from throwcollect.serve.rosbridge.rosapi import SET_PARAMETER, make_services
from throwcollect.serve.rosbridge.topics import Publishers, Subscriptions

_logger = logging.getLogger(__name__)


class Requests:
    """Carries out the operations of one client; any thread may call `receive` and `close`.

    Args:
        bridge: The bridge that the client is connected to.
        send: Called with each frame for the client, in the bridge's thread, so it may neither wait nor fail.
        read_only: Whether the client may change nothing.
    """

    def __init__(self, bridge: Bridge, send: Callable[[Frame], None], *, read_only: bool = False) -> None:
        self._client = client = Client(bridge, send)
        self._read_only = read_only
        self._inbox: deque[Frame] = deque()
        self._reassembly = Reassembly()
        self._services = make_services(client)
        topics, publishers, goals = Subscriptions(client), Publishers(client), Goals(client)
        services = Advertised(client, "srv")
        actions = Advertised(client, "action")
        self._resources = (topics, publishers, services, actions, goals)
        self._operations: Mapping[str, Callable[[Any], None]] = {
            "subscribe": topics.subscribe,
            "unsubscribe": topics.unsubscribe,
            "advertise": publishers.advertise,
            "unadvertise": publishers.unadvertise,
            "publish": publishers.publish,
            "call_service": self._call_service,
            "advertise_service": services.advertise,
            "unadvertise_service": services.unadvertise,
            "service_response": services.take,
            "send_action_goal": goals.send,
            "cancel_action_goal": goals.cancel,
            "advertise_action": actions.advertise,
            "unadvertise_action": actions.unadvertise,
            "action_feedback": actions.take,
            "action_result": actions.take,
            "action_status": actions.take,
            "fragment": self._add_fragment,
            "set_level": self._set_level,
            "status": lambda asked: _logger.info("a client reports: %s", asked.msg),
        }

    @property
    def waiting(self) -> int:
        """Number of received frames that wait to be handled."""
        return len(self._inbox)

    def receive(self, frame: Frame) -> None:
        """Take a frame of the client; if something is wrong with it, the client gets the reason."""
        self._inbox.append(frame)
        self._client.bridge.submit(lambda: self._handle(self._inbox.popleft()))

    def close(self) -> None:
        """Withdraw all that the client had."""
        self._client.bridge.submit(self._close)

    def _close(self) -> None:
        self._client.is_closed = True
        for each in self._resources:
            each.close()

    def _handle(self, frame: Frame) -> None:
        if self._client.is_closed:
            return
        fields: Mapping[str, Any] = {}
        try:
            fields = read_frame(frame)
            asked = read_operation(fields)
            if asked.op not in MAY_READ:
                self._require_writing(asked.op)
            self._operations[asked.op](asked)
        except ThrowcollectError as error:
            self._client.fail(fields, error)
        except Exception as error:
            # A frame of one client must not end the bridge, which serves other clients, too.
            _logger.exception("a request of a client failed")
            self._client.fail(fields, f"this could not be done: {type(error).__name__}: {error}")

    def _call_service(self, asked: CallService) -> None:
        name = asked.name.lstrip("/")
        if name not in self._services or name == SET_PARAMETER:
            self._require_writing(asked.name)
        self._services.get(name, call_node)(Call(self._client, asked))

    def _require_writing(self, what: str) -> None:
        if self._read_only:
            raise ConfigError(f"{what}: this client may only look", expected="the token of those who may act")

    def _set_level(self, asked: Status) -> None:
        self._client.level = asked.level

    def _add_fragment(self, part: Fragment) -> None:
        frame = self._reassembly.add(part)
        if frame is not None:
            self._handle(frame)
