"""The genuine rclpy, whatever RMW it uses, where it is installed."""

from __future__ import annotations

import itertools
import logging
import os
import traceback
from contextlib import suppress
from importlib import import_module
from typing import Any

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy import (
    create_node,
    ok,
    shutdown,
    spin,
    spin_once,
    spin_until_future_complete,
    try_shutdown,
)
from rclpy.action import (
    ActionClient,
    ActionServer,
    CancelResponse,
    GoalResponse,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.time import Time

from throwcollect.errors import ThrowcollectError
from throwcollect.ros.fast_dds import PLAIN_DISCOVERY, PROFILE_VARIABLE, client_profile, write_temporarily
from throwcollect.ros.middleware import Middleware
from throwcollect.ros.session_config import OPEN, connect_endpoint, is_protected

_looks = itertools.count()


def init(args: list[str] | None = None, *, context: Context | None = None, domain_id: int | None = None) -> None:
    """Initialise a context, as ``rclpy.init`` does but for signals: they are left to whoever handles them.

    rclpy's own handlers would take the context away from nodes that still have to finish something.

    Args:
        args: Command line arguments.
        context: The context; None for the default one.
        domain_id: Domain identifier; None takes ``ROS_DOMAIN_ID``, or 0.

    Raises:
        RuntimeError: If the context is in use already.
        ConfigError: If a variable of the environment does not hold what it should.
        ThrowcollectError: If the RMW does not start, as rmw_zenoh_cpp does not without a router.
    """
    middleware = Middleware("rclpy", rclpy.get_rmw_implementation_identifier())
    endpoint = connect_endpoint()
    if middleware.is_fast_dds and endpoint is not None and not endpoint.startswith(OPEN):
        profile = write_temporarily(client_profile(endpoint))
        os.environ.update({PROFILE_VARIABLE: str(profile), **PLAIN_DISCOVERY})
    try:
        rclpy.init(args=args, context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:
        raise ThrowcollectError(f"ROS 2 does not start: {error}") from error


def get_message(name: str) -> Any:
    """Class of a message.

    Args:
        name: Full name, such as ``sensor_msgs/msg/JointState``.

    Raises:
        ValueError: If no such message is installed, or the name is not one of a message.
    """
    return _interface(name, "msg")


def get_service(name: str) -> Any:
    """Class of a service, which holds the classes of its request and response.

    Args:
        name: Full name, such as ``std_srvs/srv/Trigger``.

    Raises:
        ValueError: If no such service is installed, or the name is not one of a service.
    """
    return _interface(name, "srv")


def get_action(name: str) -> Any:
    """Class of an action, which holds the classes of its goal, result and feedback.

    Args:
        name: Full name, such as ``control_msgs/action/FollowJointTrajectory``.

    Raises:
        ValueError: If no such action is installed, or the name is not one of an action.
    """
    return _interface(name, "action")


def _interface(name: str, kind: str) -> Any:
    package, separator, short = name.partition(f"/{kind}/")
    if not (separator and package.isidentifier() and short.isidentifier()):
        raise ValueError(f"expected a name of the form package/{kind}/Name, got {name!r}")
    try:
        return getattr(import_module(f"{package}.{kind}"), short)
    except (AttributeError, ModuleNotFoundError) as error:
        raise ValueError(f"unknown interface {name!r}: it is not installed") from error


def graph_changes(_node: Node) -> int:
    """A number that differs from what it was before whenever the ROS graph has changed in between.

    rclpy does not tell of changes, so there may always have been one.
    """
    return next(_looks)


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that lets nobody in without a key: other RMWs know of no key.

    Raises:
        ConfigError: If an environment variable does not hold what it should.
    """
    return Middleware("rclpy", rclpy.get_rmw_implementation_identifier()).keeps_others_out and is_protected()


def spin_some(executor: Executor, timeout_sec: float) -> None:
    """Wait for an input, then call back with it and all others that have come by then, but none that come meanwhile.

    Up to rclpy 7.1.8, the executor of a node that carries out a goal does not wait.

    Args:
        executor: The executor.
        timeout_sec: Longest time to wait [s].
    """
    wait = timeout_sec
    with suppress(TimeoutException):
        while True:
            callback, _, _ = executor.wait_for_ready_callbacks(timeout_sec=wait)
            callback()
            error = callback.exception()
            if error is not None and not _is_of_request(error):
                raise error
            if error is not None:
                get_logger("rclpy").warning(
                    f"a request that cannot be read is left without an answer: {error}", throttle_duration_sec=1.0
                )
            # From now on the executor looks once at all that is ready, and says so at the end of that.
            wait = 0.0


def _is_of_request(error: BaseException) -> bool:
    """Whether rclpy itself stumbled over what a request says, such as a parameter of a type that there is not.

    Nobody who may send requests to a node shall be able to end it.
    """
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    return isinstance(error, ValueError) and not any(name.startswith("throwcollect.") for name in modules)


def pass_on_log(node: Node, record: logging.LogRecord) -> None:
    """Log what was logged by Python's own logging, under a node's name and with the place that it came from."""
    # A logger itself would name this place.
    rclpy_implementation.rclpy_logging_rcutils_log(
        record.levelno,
        node.get_logger().name,
        record.getMessage(),
        record.funcName,
        record.pathname,
        record.lineno,
    )


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows what ``set_ros_time_override`` was last given."""
    # As rclpy's own time source does it; there is no public way.
    node.get_clock()._set_ros_time_is_active(True)


__all__ = [
    "ActionClient",
    "ActionServer",
    "CancelResponse",
    "Context",
    "DurabilityPolicy",
    "Executor",
    "ExternalShutdownException",
    "FloatingPointRange",
    "Future",
    "GoalResponse",
    "HistoryPolicy",
    "IntegerRange",
    "Node",
    "Parameter",
    "ParameterDescriptor",
    "Publisher",
    "QoSProfile",
    "ReliabilityPolicy",
    "SetParametersResult",
    "SingleThreadedExecutor",
    "Time",
    "create_node",
    "get_action",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
    "get_message",
    "get_service",
    "graph_changes",
    "init",
    "joins_protected",
    "ok",
    "pass_on_log",
    "provide_time",
    "shutdown",
    "spin",
    "spin_once",
    "spin_some",
    "spin_until_future_complete",
    "try_shutdown",
]
