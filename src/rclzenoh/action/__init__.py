"""Actions by the API of ``rclpy.action``."""

from rclzenoh.action.client import ActionClient, ClientGoalHandle
from rclzenoh.action.graph import (
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from rclzenoh.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclzenoh.interfaces.msg import GoalStatus

__all__ = [
    "ActionClient",
    "ActionServer",
    "CancelResponse",
    "ClientGoalHandle",
    "GoalResponse",
    "GoalStatus",
    "ServerGoalHandle",
    "get_action_client_names_and_types_by_node",
    "get_action_names_and_types",
    "get_action_server_names_and_types_by_node",
]
