"""One client of a bridge: its requests, and all that it has in the ROS graph."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping

from throwcollect.errors import ConfigError, ThrowcollectError
from throwcollect.serve.rosbridge.codec import Frame, Reassembly, read_frame
from throwcollect.serve.rosbridge.errands import Goal, Goals, Questions
from throwcollect.serve.rosbridge.offers import OfferedAction, OfferedService, Offers
from throwcollect.serve.rosbridge.peer import LEVELS, Peer, PeerHost
from throwcollect.serve.rosbridge.request import BridgeRequest, Form, RequestId, sentence
from throwcollect.serve.rosbridge.rosapi import GET_FILE, SET_PARAMETER, Answer, Rosapi, give_file
from throwcollect.serve.rosbridge.service_calls import Call, call_node
from throwcollect.serve.rosbridge.topics import Publishers, Subscriptions
from throwcollect.wording import suggest

_MOST_FRAMES = 1000
_MOST_BYTES = 32 * 2**20
"""Limits of frames that wait while the run has no router."""


Operation = Callable[[BridgeRequest], None]

_logger = logging.getLogger(__name__)

_LOSS = "too many requests wait for the router of the run; further ones are dropped until it is back"


class BridgeClient(Peer):
    """One client. Any thread may call `receive` and `close`; only the bridge's thread may call everything else."""

    def __init__(self, host: PeerHost, send: Callable[[Frame], None], *, read_only: bool) -> None:
        super().__init__(host, send)
        self._read_only = read_only
        self._inbox = Inbox()
        self._was_told_of_loss = False
        self._questions = Questions(self)
        self._goals = Goals(self)
        subscriptions, publishers = Subscriptions(self), Publishers(self)
        services = Offers(self, "service", OfferedService)
        actions = Offers(self, "action", OfferedAction, probe="/_action/send_goal")
        self._parts = (subscriptions, publishers, services, actions, self._questions, self._goals)
        self._reassembly = Reassembly()
        rosapi = Rosapi(self, self._questions).answers
        self._answers: Mapping[str, Answer] = {**rosapi, GET_FILE: give_file}
        self._reading_operations: Mapping[str, Operation] = {
            "subscribe": subscriptions.subscribe,
            "unsubscribe": subscriptions.unsubscribe,
            "call_service": self._call_service,
            "fragment": self._add_fragment,
            "set_level": self._set_level,
            "status": self._take_status,
            "auth": self._authenticate,
        }
        self._changing_operations: Mapping[str, Operation] = {
            "advertise": publishers.advertise,
            "unadvertise": publishers.unadvertise,
            "publish": publishers.publish,
            "advertise_service": services.advertise,
            "unadvertise_service": services.unadvertise,
            "service_response": services.pass_on(OfferedService.respond),
            "send_action_goal": self._send_goal,
            "cancel_action_goal": self._goals.cancel,
            "advertise_action": actions.advertise,
            "unadvertise_action": actions.unadvertise,
            "action_feedback": actions.pass_on(OfferedAction.publish_feedback),
            "action_result": actions.pass_on(OfferedAction.end),
            "action_status": actions.pass_on(OfferedAction.take_status),
        }

    @property
    def waiting(self) -> int:
        """Number of received frames that wait to be handled."""
        return len(self._inbox)

    def receive(self, frame: Frame) -> None:
        """Take a frame of the client; if something is wrong with it, the client gets a status message.

        Without a router, frames wait. If too many wait, further ones are dropped, and the client is told once.
        """
        if self._inbox.is_full and not self.host.is_connected:
            if not self._was_told_of_loss:
                self._was_told_of_loss = True
                self.host.submit(lambda: self.say("error", _LOSS))
            return
        self._inbox.put(frame)
        self.host.submit(self._handle_next)

    def close(self) -> None:
        """Withdraw all that the client had."""
        self.host.submit(self._close)

    def _handle_next(self) -> None:
        """Handle one frame of the client, so that other clients have their turn; without a router, frames wait."""
        if self._inbox and self.host.is_connected and not self._is_closed:
            self._handle(self._inbox.take())

    def lose(self) -> None:
        """Forget the session, as the router has gone, and tell the client."""
        for part in self._parts:
            part.lose()
        self.say("error", "the router of the run has gone; new requests wait until it is back")

    def restore(self) -> None:
        """Make everything that the client had again, in a new session."""
        self._was_told_of_loss = False
        for part in self._parts:
            part.restore()
        # This message cancels the error that `lose` has sent, so clients that only want errors get it, too.
        if self._level != "none":
            self.answer({"op": "status", "level": "info", "msg": "the router of the run is back"}, Form())
        # `receive` has submitted an action for each of these frames, which left it where it was, without a router.
        for _ in range(self.waiting):
            self.host.submit(self._handle_next)

    def _close(self) -> None:
        if not self._is_closed:
            self._is_closed = True
            self._inbox.clear()
            self.host.forget(self)
            for part in self._parts:
                part.close()

    def _handle(self, frame: Frame) -> None:
        number: RequestId = None
        try:
            request = read_frame(frame)
            number = request.id
            operation = self._reading_operations.get(request.op) or self._changing_operations.get(request.op)
            if operation is None:
                known = [*self._reading_operations, *self._changing_operations]
                raise ConfigError(f"no operation {request.op}{suggest(request.op, known, 'docs/rosbridge.md')}")
            # A client that sends a goal waits for a result, so `_send_goal` refuses with a result instead of a status.
            if request.op in self._changing_operations and request.op != "send_action_goal":
                self._require_writing(request.op)
            operation(request)
        except ThrowcollectError as error:
            self.say("error", sentence(error), number)
        except Exception as error:
            # A frame of one client must not end the bridge, which serves other clients, too.
            _logger.exception("a request of a client failed")
            self.say("error", f"this could not be done: {type(error).__name__}: {error}", number)

    def _set_level(self, request: BridgeRequest) -> None:
        level = request.text("level")
        if level not in LEVELS:
            raise ConfigError(f"set_level: no level {level}", expected="info, warning, error or none")
        self._level = level

    def _call_service(self, request: BridgeRequest) -> None:
        call = Call(self, request)
        try:
            call.form = request.form()
            name = call.given.lstrip("/")
            if name not in self._answers or name == SET_PARAMETER:
                self._require_writing(call.given)
            if name in self._answers:
                self._answers[name](call)
            else:
                call_node(self, self._questions, call, request)
        except ThrowcollectError as error:
            call.fail(sentence(error))

    def _send_goal(self, request: BridgeRequest) -> None:
        goal = Goal(self, request)
        try:
            self._require_writing(request.op)
            self._goals.send(goal, request)
        except ThrowcollectError as error:
            goal.fail(sentence(error))

    def _require_writing(self, what: str) -> None:
        """Refuse a request that changes something if this client may only look."""
        if self._read_only:
            raise ConfigError(f"{what}: this client may only look", expected="the token of those who may act")

    def _add_fragment(self, request: BridgeRequest) -> None:
        frame = self._reassembly.add(request)
        if frame is not None:
            self._handle(frame)

    def _take_status(self, request: BridgeRequest) -> None:
        _logger.info("a client says: %s", request.text_or("msg", ""))

    def _authenticate(self, request: BridgeRequest) -> None:
        """Refuse the operation by which clients of ROS 1 authenticate themselves."""
        raise ConfigError(f"{request.op}: clients do not authenticate here", expected="the token in the address")


class Inbox:
    """A queue of frames, which any thread may use."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._frames: deque[Frame] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def is_full(self) -> bool:
        """Whether the frames that wait have reached a limit; who must not lose a frame may add it nevertheless."""
        return len(self._frames) >= _MOST_FRAMES or self._bytes >= _MOST_BYTES

    def put(self, frame: Frame) -> None:
        """Add a frame."""
        with self._lock:
            self._frames.append(frame)
            self._bytes += len(frame)

    def take(self) -> Frame:
        """Take the oldest frame."""
        with self._lock:
            frame = self._frames.popleft()
            self._bytes -= len(frame)
            return frame

    def clear(self) -> None:
        """Forget all frames."""
        with self._lock:
            self._frames.clear()
            self._bytes = 0
