"""Reads the frames of one client, and has each operation carried out."""

from __future__ import annotations

import inspect
import logging
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.rosbridge.advertised import Advertised
from throwcollect.serve.rosbridge.bridge import Bridge, Client
from throwcollect.serve.rosbridge.calls import Goals, call_node
from throwcollect.serve.rosbridge.codec import Frame, Reassembly, read_frame
from throwcollect.serve.rosbridge.operations import (
    MAY_READ,
    Arguments,
    CallService,
    Fragment,
    SetLevel,
    read_fields,
    read_operation,
)
from throwcollect.serve.rosbridge.rosapi import SET_PARAMETER, make_services
from throwcollect.serve.rosbridge.topics import Publishers, Subscriptions

_logger = logging.getLogger(__name__)
_UNKNOWN = 0
"""Of action_msgs/msg/GoalStatus."""


class Requests(Client):
    """A client whose operations are carried out.

    Any thread may call `receive` and `close`; everything else belongs to the thread of the bridge.

    Args:
        bridge: The bridge that the client is connected to.
        send: Called with each frame for the client, in the bridge's thread, so it may neither wait nor fail.
        read_only: Whether the client may change nothing.
    """

    def __init__(self, bridge: Bridge, send: Callable[[Frame], None], *, read_only: bool = False) -> None:
        super().__init__(bridge, send)
        self._read_only = read_only
        self._inbox: deque[Frame] = deque()
        self._reassembly = Reassembly()
        self._services = make_services(self)
        topics, publishers, goals = Subscriptions(self), Publishers(self), Goals(self)
        services, actions = Advertised(self, "srv"), Advertised(self, "action")
        self._resources = (topics, publishers, services, actions, goals)
        self._operations: Mapping[str, Callable[[Any], object]] = {
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
        }

    @property
    def waiting(self) -> int:
        """Number of received frames that wait to be handled."""
        return len(self._inbox)

    def receive(self, frame: Frame) -> None:
        """Take a frame of the client; if something is wrong with it, the client gets the reason."""
        self._inbox.append(frame)
        self.bridge.submit(lambda: self._carry_on(self._carry_out(self._inbox.popleft())))

    def close(self) -> None:
        """Withdraw all that the client had."""
        self.bridge.submit(self._close)

    def _close(self) -> None:
        self.is_closed = True
        for each in self._resources:
            each.close()

    async def _carry_out(self, frame: Frame) -> None:
        fields: Mapping[str, Any] = {}
        try:
            fields = read_frame(frame)
            asked = read_operation(fields)
            if asked.op not in MAY_READ:
                self._require_writing(asked.op)
            work = self._operations[asked.op](asked)
            if inspect.isawaitable(work):
                await work
        except (ThrowcollectError, ValueError) as error:
            self._fail(fields, str(error))
        except Exception as error:
            # A frame of one client must not end the bridge, which serves other clients, too.
            _logger.exception("a request of a client failed")
            self._fail(fields, f"this could not be done: {type(error).__name__}: {error}")

    def _carry_on(self, work: Coroutine[Any, None, None]) -> None:
        """Carry on with an operation until it ends or waits; when the client has left, it ends without an answer.

        rclpy would look at a task that waits again and again, and keep a processor busy.
        """
        if self.is_closed:
            work.close()
            return
        try:
            future, seconds = work.send(None)
        except StopIteration:
            return
        # The future or the time, whichever comes first, takes the operation out of the list.
        left = [work]

        def resume(_: object = None) -> None:
            if left:
                self._carry_on(left.pop())

        self.bridge.later(seconds, resume)
        if future is not None:
            future.add_done_callback(resume)

    def _fail(self, fields: Mapping[str, Any], reason: str) -> None:
        """Send in one line why an operation was not carried out, in the place of the answer that the client awaits."""
        sentence = "; ".join(line.strip() for line in reason.splitlines())
        number = fields.get("id") if isinstance(fields.get("id"), str | int) else None
        failure = {"id": number, "values": sentence, "result": False}
        match fields.get("op"):
            case "call_service":
                self.answer({"op": "service_response", "service": fields.get("service"), **failure})
            case "send_action_goal":
                self.answer({"op": "action_result", "action": fields.get("action"), "status": _UNKNOWN, **failure})
            case _:
                self.report("error", sentence, number)

    async def _call_service(self, asked: CallService) -> None:
        name = asked.name.lstrip("/")
        service = self._services.get(name)
        if service is None or name == SET_PARAMETER:
            self._require_writing(asked.name)
        if service is None:
            values = call_node(self, asked)
        else:
            given = asked.args if isinstance(asked.args, Mapping) else {}
            values = service(read_fields(Arguments.model_validate, given, f"{asked.name}: "))
        if inspect.isawaitable(values):
            values = await values
        fields = {"op": "service_response", "id": asked.id, "service": asked.name}
        self.answer({**fields, "values": values, "result": True}, asked.compression)

    def _require_writing(self, what: str) -> None:
        if self._read_only:
            raise ConfigError(f"{what}: this client may only look", expected="the token of those who may act")

    async def _add_fragment(self, part: Fragment) -> None:
        frame = self._reassembly.add(part)
        if frame is not None:
            await self._carry_out(frame)

    def _set_level(self, asked: SetLevel) -> None:
        self.level = asked.level
