"""Interfaces whose fields type checkers know, by their short names, which differ from each other within a kind.

`get_message`, `get_service` and `get_action` give classes of all other interfaces, without types. After a change here,
``python packaging/interface_stubs.py`` writes the stubs again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping


def look_up_in(names: Mapping[str, str], find_class: Callable[[str], object], module: str) -> Callable[[str], object]:
    """Make ``__getattr__`` of a module that has the classes of all these names and finds each when it is asked for."""

    def find(name: str) -> object:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        return find_class(names[name])

    return find


def _make_full_names(kind: str, by_package: Mapping[str, str]) -> Mapping[str, str]:
    return {name: f"{package}/{kind}/{name}" for package, names in by_package.items() for name in names.split()}


MESSAGES = _make_full_names(
    "msg",
    {
        "action_msgs": "GoalInfo GoalStatus GoalStatusArray",
        "builtin_interfaces": "Duration Time",
        "control_msgs": "JointComponentTolerance JointTolerance JointTrajectoryControllerState SpeedScalingFactor",
        "controller_manager_msgs": "ChainConnection ControllerState",
        "diagnostic_msgs": "DiagnosticArray DiagnosticStatus KeyValue",
        "geometry_msgs": "Accel Point Pose PoseStamped PoseWithCovariance Quaternion Transform TransformStamped Twist "
        "TwistWithCovariance Vector3",
        "nav_msgs": "Odometry",
        "rcl_interfaces": "FloatingPointRange IntegerRange ListParametersResult Log Parameter ParameterDescriptor "
        "ParameterEvent ParameterValue SetParametersResult",
        "rosgraph_msgs": "Clock",
        "sensor_msgs": "CompressedImage JointState PointCloud2 PointField",
        "simulation_interfaces": "Bounds EntityCategory EntityFilters EntityInfo EntityState Resource Result "
        "SimulationState SimulatorFeatures SpawnEntity SpawnResult Spawnable TagsFilter",
        "std_msgs": "ColorRGBA Header MultiArrayDimension MultiArrayLayout String UInt8MultiArray",
        "tf2_msgs": "TFMessage",
        "trajectory_msgs": "JointTrajectory JointTrajectoryPoint MultiDOFJointTrajectory MultiDOFJointTrajectoryPoint",
        "unique_identifier_msgs": "UUID",
        "visualization_msgs": "Marker MarkerArray MeshFile UVCoordinate",
    },
)
"""Full names of messages."""

SERVICES = _make_full_names(
    "srv",
    {
        "action_msgs": "CancelGoal",
        "control_msgs": "QueryTrajectoryState",
        "controller_manager_msgs": "ListControllers",
        "rcl_interfaces": "DescribeParameters GetParameterTypes GetParameters ListParameters SetParameters "
        "SetParametersAtomically",
        "simulation_interfaces": "DeleteEntity GetEntities GetEntitiesStates GetEntityBounds GetEntityInfo "
        "GetEntityState GetSimulationState GetSimulatorFeatures GetSpawnables ResetSimulation SetEntityInfo "
        "SetEntityState SetSimulationState SpawnEntities SpawnEntity StepSimulation",
    },
)
"""Full names of services."""

ACTIONS = _make_full_names(
    "action", {"control_msgs": "FollowJointTrajectory", "simulation_interfaces": "SimulateSteps"}
)
"""Full names of actions."""
