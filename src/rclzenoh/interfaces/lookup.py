"""Classes of services and actions by name, as ``rosidl_runtime_py.utilities`` gives them."""

from __future__ import annotations

from functools import cache
from typing import ClassVar

from rclzenoh.interfaces.catalog import structure
from rclzenoh.interfaces.message import AnyMessage, message_class


class Service:
    """Base of all service classes."""

    TYPE: ClassVar[str]
    Request: ClassVar[type[AnyMessage]]
    Response: ClassVar[type[AnyMessage]]


class ActionProtocol:
    """Services and messages by which an action is carried out."""

    SendGoalService: ClassVar[type[Service]]
    GetResultService: ClassVar[type[Service]]
    FeedbackMessage: ClassVar[type[AnyMessage]]


class Action:
    """Base of all action classes."""

    TYPE: ClassVar[str]
    Goal: ClassVar[type[AnyMessage]]
    Result: ClassVar[type[AnyMessage]]
    Feedback: ClassVar[type[AnyMessage]]
    Impl: ClassVar[type[ActionProtocol]]


def get_message(name: str) -> type[AnyMessage]:
    """Class of a message, such as ``sensor_msgs/msg/JointState``."""
    _expect_kind(name, "msg")
    return message_class(name)


@cache
def get_service(name: str) -> type[Service]:
    """Class of a service, such as ``std_srvs/srv/Trigger``; it has the classes of the request and the response."""
    _expect_kind(name, "srv")
    structure(name)  # This refuses an unknown service by its own name instead of that of its request.
    return _make_service(name)


@cache
def get_action(name: str) -> type[Action]:
    """Class of an action, such as ``control_msgs/action/FollowJointTrajectory``, with the classes of its parts."""
    _expect_kind(name, "action")
    structure(name)
    parts = {part: message_class(f"{name}_{part}") for part in ("Goal", "Result", "Feedback")}
    protocol = {
        "SendGoalService": _make_service(f"{name}_SendGoal"),
        "GetResultService": _make_service(f"{name}_GetResult"),
        "FeedbackMessage": message_class(f"{name}_FeedbackMessage"),
    }
    short = name.rpartition("/")[2]
    return type(short, (Action,), {"TYPE": name, **parts, "Impl": type("Impl", (ActionProtocol,), protocol)})


def _make_service(name: str) -> type[Service]:
    parts = {part: message_class(f"{name}_{part}") for part in ("Request", "Response")}
    return type(name.rpartition("/")[2], (Service,), {"TYPE": name, **parts})


def _expect_kind(name: str, kind: str) -> None:
    if name.split("/")[1:2] != [kind]:
        raise ValueError(f"expected a name of the form package/{kind}/Name, got {name!r}")
