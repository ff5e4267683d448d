"""Joint trajectory control: the arithmetic and decisions of ros2_controllers, without ROS or physics.

A `JointTrajectoryController` is driven by a clock and measured states; it knows neither messages nor simulations.
"""

from throwcollect.control.controller import REPEATED, JointTrajectoryController
from throwcollect.control.parameters import Constraints, ControllerParameters, JointConstraints
from throwcollect.control.values import (
    ControllerState,
    ErrorCode,
    GoalResult,
    GoalStatus,
    JointState,
    JointTolerance,
    Trajectory,
    TrajectoryGoal,
    TrajectoryPoint,
    TrajectoryRefusal,
    TrajectoryState,
)

__all__ = [
    "REPEATED",
    "Constraints",
    "ControllerParameters",
    "ControllerState",
    "ErrorCode",
    "GoalResult",
    "GoalStatus",
    "JointConstraints",
    "JointState",
    "JointTolerance",
    "JointTrajectoryController",
    "Trajectory",
    "TrajectoryGoal",
    "TrajectoryPoint",
    "TrajectoryRefusal",
    "TrajectoryState",
]
