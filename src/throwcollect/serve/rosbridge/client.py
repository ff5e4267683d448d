"""One client of a bridge: what it asks, and all that it has in the ROS graph."""

from __future__ import annotations

import itertools
import logging
from collections import deque
from collections.abc import Callable, Mapping
from typing import Protocol

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.rosbridge.codec import Frame, cbor_bytes, fragments, json_text, read_frame
from throwcollect.serve.rosbridge.peer import Level, Part
from throwcollect.serve.rosbridge.request import Form, Request, RequestId, sentence
from throwcollect.serve.rosbridge.rosapi import Rosapi
from throwcollect.serve.rosbridge.service_calls import Call, ServiceCalls
from throwcollect.serve.rosbridge.session import Session
from throwcollect.serve.rosbridge.subscriptions import Subscriptions

_logger = logging.getLogger(__name__)

_LEVELS = ("none", "error", "warning", "info")
_numbers = itertools.count()


class Host(Protocol):
    """A bridge as its clients see it."""

    @property
    def session(self) -> Session:
        """Its place in the ROS graph."""

    @property
    def is_connected(self) -> bool:
        """Whether it has one."""

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Have something done after a time [s], in the bridge's thread."""

    def submit(self, action: Callable[[], None]) -> None:
        """Have something done soon, in the bridge's thread; may be called in any."""

    def forget(self, client: Client) -> None:
        """Know a client no longer."""


class Client:
    """One client. `receive` and `close` may be called in any thread, all else in that of the bridge.

    Args:
        host: The bridge.
        send: Takes each frame that leaves.
        read_only: Whether it may only look.
    """

    def __init__(self, host: Host, send: Callable[[Frame], None], *, read_only: bool) -> None:
        self._host = host
        self._send = send
        self._read_only = read_only
        self._frames: deque[Frame] = deque()
        self._level = "error"
        self._is_closed = False
        self._rosapi = Rosapi(self)
        self._subscriptions = Subscriptions(self)
        self._calls = ServiceCalls(self)
        self._parts: tuple[Part, ...] = (self._subscriptions, self._calls)
        self._operations: Mapping[str, Callable[[Request], None]] = {
            "set_level": self._set_level,
            "subscribe": self._subscriptions.subscribe,
            "unsubscribe": self._subscriptions.unsubscribe,
            "call_service": self._call_service,
        }

    @property
    def session(self) -> Session:
        """The place of the bridge in the ROS graph."""
        return self._host.session

    @property
    def waiting(self) -> int:
        """Number of frames that were received and are not worked off."""
        return len(self._frames)

    def receive(self, frame: Frame) -> None:
        """Take a frame that the client has sent; what is wrong with it, the client is told."""
        self._frames.append(frame)
        self._host.submit(self.work_off)

    def close(self) -> None:
        """Withdraw all that the client had."""
        self._host.submit(self._close)

    def work_off(self) -> None:
        """Do what the client has asked for; without a router, that waits."""
        while self._frames and self._host.is_connected and not self._is_closed:
            self._handle(self._frames.popleft())

    def lose(self) -> None:
        """Know that the router has gone, and with it all that the client had."""
        for part in self._parts:
            part.lose()
        self.say("error", "the router of the run has gone; what is asked for now waits until it is back")

    def restore(self) -> None:
        """Have everything again, in a new session."""
        for part in self._parts:
            part.restore()
        self.say("error", "the router of the run is back")
        self.work_off()

    def later(self, seconds: float, action: Callable[[], None]) -> None:
        """Have something done after a time [s]."""
        self._host.later(seconds, action)

    def send(self, frame: Frame, fragment_size: int = 0) -> None:
        """Send a frame, in parts if it is a text longer than ``fragment_size``, unless that is 0."""
        if self._is_closed:
            return
        if isinstance(frame, str) and 0 < fragment_size < len(frame):
            for part in fragments(frame, fragment_size, str(next(_numbers))):
                self._send(part)
        else:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], form: Form) -> None:
        """Send an operation; what is None is left out."""
        there = {name: value for name, value in fields.items() if value is not None}
        self.send(json_text(there) if form.compression == "none" else cbor_bytes(there), form.fragment_size)

    def say(self, level: Level, text: str, request: RequestId = None) -> None:
        """Send a status message about a request, unless the client does not want those of its level."""
        if _LEVELS.index(level) <= _LEVELS.index(self._level):
            self.answer({"op": "status", "id": request, "level": level, "msg": text}, Form())

    def _close(self) -> None:
        if not self._is_closed:
            self._is_closed = True
            self._frames.clear()
            self._host.forget(self)
            for part in self._parts:
                part.close()

    def _handle(self, frame: Frame) -> None:
        number: RequestId = None
        try:
            request = read_frame(frame)
            number = request.id
            operation = self._operations.get(request.op)
            if operation is None:
                raise ConfigError(f"no operation {request.op}", expected=", ".join(self._operations))
            operation(request)
        except ThrowcollectError as error:
            self.say("error", sentence(error), number)
        except Exception as error:
            # Whatever one client sends, the others go on.
            _logger.exception("a client of the bridge sent what could not be done")
            self.say("error", f"this could not be done: {type(error).__name__}: {error}", number)

    def _set_level(self, request: Request) -> None:
        level = request.text("level")
        if level not in _LEVELS:
            raise ConfigError(f"set_level: no level {level}", expected="info, warning, error or none")
        self._level = level

    def _call_service(self, request: Request) -> None:
        call = Call(self, request)
        try:
            answer = self._rosapi.answers.get(call.given.lstrip("/"))
            if answer is not None:
                answer(call)
            else:
                self._calls.call(call, request)
        except ThrowcollectError as error:
            call.fail(sentence(error))
