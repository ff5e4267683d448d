"""What nodes use of rclpy's API, and the little beyond it."""

from throwcollect.interfaces import get_action, get_message, get_service
from throwcollect.ros.embedded.action import (
    ActionClient,
    ActionServer,
    CancelResponse,
    GoalResponse,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from throwcollect.ros.embedded.context import Context, init, ok, shutdown, try_shutdown
from throwcollect.ros.embedded.exceptions import ExternalShutdownException
from throwcollect.ros.embedded.executors import Executor, SingleThreadedExecutor
from throwcollect.ros.embedded.extensions import graph_changes, joins_protected, pass_on_log, provide_time, spin_some
from throwcollect.ros.embedded.node import Node, create_node
from throwcollect.ros.embedded.parameter import (
    FloatingPointRange,
    IntegerRange,
    Parameter,
    ParameterDescriptor,
    SetParametersResult,
)
from throwcollect.ros.embedded.publisher import Publisher
from throwcollect.ros.embedded.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from throwcollect.ros.embedded.spinning import spin, spin_once, spin_until_future_complete
from throwcollect.ros.embedded.task import Future
from throwcollect.ros.embedded.time import Time

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
