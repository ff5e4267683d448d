"""One client of a bridge: how it is answered, and which topics and parameters are closed to it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import Any

from throwcollect.collect.coordinator_node.simulation_client import EPISODE_TOPIC
from throwcollect.errors import ConfigError
from throwcollect.plan.lease import LEASES
from throwcollect.ros.graph_names import absolute_name
from throwcollect.serve.rosbridge.bridge import Bridge
from throwcollect.serve.rosbridge.codec import Frame, encode, fragments
from throwcollect.serve.rosbridge.operations import LEVELS, Form, Level, Operation, RequestId

_PLAIN = Form()
_UNKNOWN = 0
"""Of action_msgs/msg/GoalStatus."""
_numbers = itertools.count()
_GUARDED = {
    EPISODE_TOPIC: "only the coordinator may have this topic, as a slow subscriber would hold the simulation up",
    "parameter_events": "clients may not have this topic, as it has the signed leases of trials",
}
"""Last part of the name of each topic that clients may not have, and why."""
_PARAMETER_SERVICES = tuple(
    f"rcl_interfaces/srv/{name}" for name in ("GetParameters", "SetParameters", "SetParametersAtomically")
)


class Client:
    """A client; only the thread of the bridge calls these methods.

    Args:
        bridge: The bridge that the client is connected to.
        send: Sends a frame to the client, and neither waits nor fails.

    Attributes:
        level: Status messages that the client wants.
        is_closed: Whether the client has left.
    """

    def __init__(self, bridge: Bridge, send: Callable[[Frame], None]) -> None:
        self.bridge = bridge
        self.level: Level = "error"
        self.is_closed = False
        self._send = send

    def send(self, frame: Frame, fragment_size: int = 0) -> None:
        """Send a frame, in parts if it is a string longer than ``fragment_size``, unless that is 0."""
        if self.is_closed:
            return
        if isinstance(frame, str) and 0 < fragment_size < len(frame):
            for part in fragments(frame, fragment_size, str(next(_numbers))):
                self._send(part)
        else:
            self._send(frame)

    def answer(self, fields: Mapping[str, object], form: Form = _PLAIN) -> None:
        """Send an operation; fields that are None are left out."""
        filled = {name: value for name, value in fields.items() if value is not None}
        self.send(encode(filled, form.compression), form.fragment_size)

    def report(self, level: Level, text: str, number: RequestId = None) -> None:
        """Send a status message about an operation, if the client wants messages of this level."""
        if LEVELS.index(level) <= LEVELS.index(self.level):
            self.answer({"op": "status", "id": number, "level": level, "msg": text})

    def fail(self, operation: Operation | Mapping[str, Any], reason: object) -> None:
        """Send the reason why an operation was not carried out, in the place of the answer that the client waits for.

        The operation may be the fields of a frame that could not be read. The reason is sent in one line.
        """
        sentence = "; ".join(line.strip() for line in str(reason).splitlines())
        fields = operation.model_dump(by_alias=True) if isinstance(operation, Operation) else operation
        number = fields.get("id") if isinstance(fields.get("id"), str | int) else None
        failure = {"id": number, "values": sentence, "result": False}
        match fields.get("op"):
            case "call_service":
                self.answer({"op": "service_response", "service": fields.get("service"), **failure})
            case "send_action_goal":
                self.answer({"op": "action_result", "action": fields.get("action"), "status": _UNKNOWN, **failure})
            case _:
                self.report("error", sentence, number)


def is_guarded(topic: str) -> bool:
    """Whether clients may not have a topic, given by its absolute name."""
    return topic.rpartition("/")[2] in _GUARDED


def open_topic(given: str) -> str:
    """Absolute name of a topic, given by a client's name for it."""
    topic = absolute_name(given)
    if is_guarded(topic):
        raise ConfigError(f"{topic}: {_GUARDED[topic.rpartition('/')[2]]}")
    return topic


def refuse_leases(parameter: str) -> None:
    """Refuse to read or set the parameter by which the coordinator leases trials."""
    if parameter == LEASES:
        raise ConfigError(f"{LEASES}: only the coordinator may have this parameter, as its leases are signed")


def refuse_secrets(type_name: str, request: Any) -> None:
    """Refuse a request to a service of this type that would read or set the parameter by which trials are leased."""
    if type_name not in _PARAMETER_SERVICES:
        return
    for name in [*getattr(request, "names", ()), *(each.name for each in getattr(request, "parameters", ()))]:
        refuse_leases(name)
