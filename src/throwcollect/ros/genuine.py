"""The backend on genuine rclpy, with any RMW: it has the names that `embedded` has."""

# ruff: noqa: F401 - `throwcollect.ros` looks up what is imported here.

from __future__ import annotations

import itertools
import logging
import os
import threading
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from typing import Any

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy import shutdown
from rclpy.action import (
    ActionClient,
    ActionServer,
    CancelResponse,
    GoalResponse,
    get_action_names_and_types,
)
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.exceptions import NameValidationException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.time import Time

from rclzenoh.session_config import (
    OPEN,
    OVERRIDE_VARIABLE,
    client_override,
    connect_endpoint,
    is_protected,
)
from throwcollect.errors import ThrowcollectError, WorkerError
from throwcollect.ros.connection import Connection, zenoh_errors
from throwcollect.ros.fast_dds import PLAIN_DISCOVERY, PROFILE_VARIABLE, client_profile, write_temporarily
from throwcollect.ros.middleware import RMW_VARIABLE, Middleware

_looks = itertools.count()


def init(*, context: Context | None = None, connection: Connection | None = None) -> None:
    """Initialise a context, as ``rclpy.init`` does, but without handlers of signals, which the caller may set.

    rclpy's own handlers would shut the context down while nodes still have to finish something.

    Args:
        context: The context; None for the default one.
        connection: The way into the graph; None for the one that the environment describes.
    """
    # rclpy loads its RMW when it is first used, and gets the name of the RMW only from the environment.
    os.environ[RMW_VARIABLE] = Middleware.of_process().rmw
    middleware = Middleware("rclpy", rclpy.get_rmw_implementation_identifier())
    variables: Mapping[str, str] = {}
    domain_id = None
    if connection is None:
        with zenoh_errors():
            endpoint = connect_endpoint()
    else:
        connection.check(middleware.rmw)
        endpoint = connection.endpoint
        domain_id = connection.domain_id
        variables = {OVERRIDE_VARIABLE: client_override(endpoint, connection.key)}
    if middleware.is_fast_dds and endpoint is not None and not endpoint.startswith(OPEN):
        _use_discovery_server(endpoint)
    try:
        with _environment(variables):
            rclpy.init(context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:
        raise ThrowcollectError(f"ROS 2 does not start: {error}") from error


_discovery_server: list[str] = []
"""Endpoint of the discovery server that nodes of this process use; empty if they use none."""


def _use_discovery_server(endpoint: str) -> None:
    """Let the nodes of this process find others by a discovery server of Fast DDS.

    Fast DDS reads its profile when the first node is made, and never again. So the variable stays set, and a process
    can use one discovery server only.
    """
    if _discovery_server and _discovery_server != [endpoint]:
        raise WorkerError(
            f"this process is in the run at {_discovery_server[0]}, and on Fast DDS it cannot be in that at {endpoint}",
            hint="join it from a process of its own",
        )
    profile = write_temporarily(client_profile(endpoint))
    os.environ.update({PROFILE_VARIABLE: str(profile), **PLAIN_DISCOVERY})
    _discovery_server[:] = [endpoint]


_environment_lock = threading.Lock()


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables while a context is initialised, which is when its RMW reads them."""
    with _environment_lock:
        before = {name: os.environ.get(name) for name in variables}
        os.environ.update(variables)
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value


def _find_interface(kind: str, name: str) -> Any:
    """Class of an interface, such as ``sensor_msgs/msg/JointState``."""
    package, separator, short = name.partition(f"/{kind}/")
    if not (separator and package.isidentifier() and short.isidentifier()):
        raise ValueError(f"expected a name of the form package/{kind}/Name, got {name!r}")
    try:
        return getattr(import_module(f"{package}.{kind}"), short)
    except (AttributeError, ModuleNotFoundError) as error:
        raise ValueError(f"unknown interface {name!r}: it is not installed") from error


get_message = partial(_find_interface, "msg")
get_service = partial(_find_interface, "srv")
get_action = partial(_find_interface, "action")


def graph_changes(_node: Node) -> int:
    """Return another number at each call, because rclpy does not tell whether the ROS graph has changed."""
    return next(_looks)


def let_callbacks_wait(node: Node) -> None:
    """Let a node go on with other callbacks while one of its coroutines waits."""
    # Callbacks without a group of their own belong to this group; rclpy has no public function to set it.
    node._default_callback_group = ReentrantCallbackGroup()


def joins_protected() -> bool:
    """Whether nodes of this process join a graph that rejects processes without a key: other RMWs know of no key."""
    if not Middleware("rclpy", rclpy.get_rmw_implementation_identifier()).keeps_others_out:
        return False
    with zenoh_errors():
        return is_protected()


def spin_some(executor: Executor, timeout_sec: float) -> None:
    """Wait for an input, then call the callbacks of all inputs that have arrived by then, but not of later ones.

    Up to rclpy 7.1.8, the executor of a node that carries out a goal does not wait.
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
            # Without waiting, the executor goes once through the ready callbacks, and then raises a TimeoutException.
            wait = 0.0


def stop_waiting(executor: Executor) -> None:
    """Let an executor look for work; this does not end the wait of `spin_some`, a tenth of a second at most."""
    executor.wake()


def _is_of_request(error: BaseException) -> bool:
    """Whether rclpy itself failed because of the content of a request, such as a parameter of an unknown type.

    A client must not be able to end a node by such a request.
    """
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    return isinstance(error, ValueError) and not any(name.startswith("throwcollect.") for name in modules)


def pass_on_log(node: Node, record: logging.LogRecord) -> None:
    """Log a record of Python's own logging under a node's name and with the place that the record comes from."""
    # The node's logger would give this line as the place of the record.
    rclpy_implementation.rclpy_logging_rcutils_log(
        record.levelno,
        node.get_logger().name,
        record.getMessage(),
        record.funcName,
        record.pathname,
        record.lineno,
    )


def provide_time(node: Node) -> None:
    """Make a node the source of its own time: its clock shows the last ``set_ros_time_override``.

    The node refuses `use_sim_time`, with which it would show the time of the publisher of ``/clock``, and
    the time of the system afterwards.
    """
    # rclpy's own time source does it like this; there is no public function for it.
    node.get_clock()._set_ros_time_is_active(True)
    node.add_on_set_parameters_callback(_refuse_other_time)


def _refuse_other_time(parameters: list[Parameter]) -> SetParametersResult:
    if any(parameter.name == "use_sim_time" and parameter.value for parameter in parameters):
        return SetParametersResult(successful=False, reason="use_sim_time: this node makes its time itself")
    return SetParametersResult(successful=True)
