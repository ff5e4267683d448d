"""Actions by the API of ``rclpy.action``."""

from throwcollect.ros.embedded.action.client import ActionClient, ClientGoalHandle
from throwcollect.ros.embedded.action.goals import GoalStatus
from throwcollect.ros.embedded.action.graph import (
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from throwcollect.ros.embedded.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle

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
