"""The names of rclpy's API that nodes use, and a few of our own; `context.init` begins a session."""

from rclzenoh.action.client import (
    ActionClient,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclzenoh.action.server import ActionServer, CancelResponse, GoalResponse
from rclzenoh.context import Context, shutdown
from rclzenoh.exceptions import ExternalShutdownException, NameValidationException
from rclzenoh.executors import Executor, SingleThreadedExecutor
from rclzenoh.extensions import graph_changes, let_callbacks_wait, pass_on_log, provide_time, spin_some, stop_waiting
from rclzenoh.interfaces import deserialize as deserialize_message
from rclzenoh.interfaces import get_action, get_message, get_service
from rclzenoh.interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclzenoh.node import Node
from rclzenoh.parameter import Parameter, parameter_value_to_python
from rclzenoh.publisher import Publisher
from rclzenoh.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclzenoh.task import Future
from rclzenoh.time import Time

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
    "NameValidationException",
    "Node",
    "Parameter",
    "ParameterDescriptor",
    "Publisher",
    "QoSProfile",
    "ReliabilityPolicy",
    "SetParametersResult",
    "SingleThreadedExecutor",
    "Time",
    "deserialize_message",
    "get_action",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
    "get_message",
    "get_service",
    "graph_changes",
    "let_callbacks_wait",
    "parameter_value_to_python",
    "pass_on_log",
    "provide_time",
    "shutdown",
    "spin_some",
    "stop_waiting",
]
