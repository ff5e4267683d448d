"""The ROS 2 face of one limb: its FollowJointTrajectory action, its trajectory topic and its state topic."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from typing import Any

from throwcollect.control import GoalResult, GoalStatus, JointTolerance, Trajectory, TrajectoryGoal, TrajectoryPoint
from throwcollect.ros import ActionServer, CancelResponse, Future, GoalResponse, Node, get_action, get_message
from throwcollect.sim.simulation import Simulation

FollowJointTrajectory: Any = get_action("control_msgs/action/FollowJointTrajectory")
JointTrajectoryControllerState: Any = get_message("control_msgs/msg/JointTrajectoryControllerState")
JointTrajectory: Any = get_message("trajectory_msgs/msg/JointTrajectory")
JointTrajectoryPoint: Any = get_message("trajectory_msgs/msg/JointTrajectoryPoint")

_NS = 10**9
_RESULT_TIMEOUT_S = 10
"""How long a result can be asked for, on the simulation's clock; rcl's default."""


class LimbInterface:
    """Offers one controller under the names that it has on the real robot, relative to the node's namespace.

    Args:
        node: The simulation's node.
        simulation: The simulation.
        controller: Name of the controller.
    """

    def __init__(self, node: Node, simulation: Simulation, controller: str) -> None:
        self._node = node
        self._simulation = simulation
        self._controller = controller
        self._count = 0
        self._told_ns = 0
        self._considered: deque[int] = deque()
        self._keys: dict[bytes, int] = {}
        self._handles: dict[Hashable, Any] = {}
        self._results: dict[Hashable, Future] = {}
        self._server = ActionServer(
            node,
            FollowJointTrajectory,
            f"{controller}/follow_joint_trajectory",
            execute_callback=self._execute,
            goal_callback=self._consider,
            handle_accepted_callback=self._accept,
            cancel_callback=self._cancel,
            result_timeout=_RESULT_TIMEOUT_S,
        )
        self._feedback_topic = f"{controller}/follow_joint_trajectory/_action/feedback"
        node.create_subscription(JointTrajectory, f"{controller}/joint_trajectory", self._follow, 10)
        self._states = node.create_publisher(JointTrajectoryControllerState, f"{controller}/controller_state", 10)

    def finish(self, result: GoalResult) -> None:
        """Answer whoever waits for the result of a goal."""
        if (future := self._results.get(result.goal_id)) is not None:
            future.set_result(result)
            # No feedback after the end, which may lie within the slice of time that has just passed.
            self._handles.pop(result.goal_id, None)

    @property
    def heard(self) -> bool:
        """Whether somebody listens to the controller's state or to its feedback."""
        return self._wants_state or self._node.count_subscribers(self._feedback_topic) > 0

    @property
    def watched(self) -> bool:
        """Whether somebody listens to the controller's state, or to feedback that there is."""
        return self._wants_state or self._wants_feedback

    @property
    def _wants_state(self) -> bool:
        return bool(self._states.get_subscription_count())

    @property
    def _wants_feedback(self) -> bool:
        return bool(self._results) and self._node.count_subscribers(self._feedback_topic) > 0

    def publish_state(self) -> None:
        """Publish the controller's state, and the feedback of its goal, to whoever listens."""
        if not self.watched:
            return
        state = self._simulation.controller_state(self._controller)
        desired, actual, error = map(_point_message, (state.desired, state.actual, state.error))
        if self._wants_state:
            message = JointTrajectoryControllerState(
                joint_names=list(state.joint_names),
                reference=desired,
                feedback=actual,
                error=error,
                output=_point_message(state.output),
                speed_scaling_factor=1.0,
            )
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, _NS)
            self._states.publish(message)
        if self._wants_feedback and self._simulation.now_ns != self._told_ns:
            self._told_ns = self._simulation.now_ns
            feedback = FollowJointTrajectory.Feedback(
                joint_names=list(state.joint_names), desired=desired, actual=actual, error=error
            )
            feedback.header.stamp.sec, feedback.header.stamp.nanosec = divmod(state.stamp_ns, _NS)
            for handle in self._handles.values():
                handle.publish_feedback(feedback)

    def _consider(self, request: Any) -> GoalResponse:
        # The controller takes the goal here, as it alone can tell whether it is acceptable. Its handle follows in the
        # same order, but perhaps after the next goal, or after its own end.
        refusal = self._simulation.submit(self._controller, self._count + 1, _goal(request))
        if refusal is not None:
            self._node.get_logger().error(refusal)
            return GoalResponse.REJECT
        self._count += 1
        # There is nothing to tell of a goal before time has passed.
        self._told_ns = self._simulation.now_ns
        self._considered.append(self._count)
        self._results[self._count] = Future()
        return GoalResponse.ACCEPT

    def _accept(self, handle: Any) -> None:
        key = self._considered.popleft()
        self._keys[_uuid(handle)] = key
        self._handles[key] = handle
        handle.execute()

    def _cancel(self, handle: Any) -> CancelResponse:
        # Its result reaches the client when the goal's execution goes on, after this answer.
        key = self._keys.get(_uuid(handle))
        cancelled = key is not None and self._simulation.cancel(self._controller, key)
        return CancelResponse.ACCEPT if cancelled else CancelResponse.REJECT

    async def _execute(self, handle: Any) -> Any:
        key = self._keys[_uuid(handle)]
        result: GoalResult = await self._results[key]
        del self._keys[_uuid(handle)], self._results[key]
        self._handles.pop(key, None)
        if result.status == GoalStatus.SUCCEEDED:
            handle.succeed()
        elif result.status == GoalStatus.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return FollowJointTrajectory.Result(error_code=int(result.error_code), error_string=result.error_string)

    def _follow(self, message: Any) -> None:
        refusal = self._simulation.follow(self._controller, _trajectory(message))
        if refusal is not None:
            self._node.get_logger().error(refusal)


def _uuid(handle: Any) -> bytes:
    return bytes(bytearray(handle.goal_id.uuid))


def _nanoseconds(duration: Any) -> int:
    return int(duration.sec) * _NS + int(duration.nanosec)


def _trajectory(message: Any) -> Trajectory:
    stamp_ns = _nanoseconds(message.header.stamp)
    return Trajectory(
        joint_names=tuple(message.joint_names),
        points=tuple(
            TrajectoryPoint(
                _nanoseconds(point.time_from_start),
                point.positions,
                point.velocities,
                point.accelerations,
                point.effort,
            )
            for point in message.points
        ),
        # A stamp of zero is ROS' way of leaving it out.
        stamp_ns=stamp_ns or None,
    )


def _tolerances(messages: Any) -> tuple[JointTolerance, ...]:
    return tuple(
        JointTolerance(message.name, message.position, message.velocity, message.acceleration) for message in messages
    )


def _goal(message: Any) -> TrajectoryGoal:
    return TrajectoryGoal(
        trajectory=_trajectory(message.trajectory),
        path_tolerance=_tolerances(message.path_tolerance),
        goal_tolerance=_tolerances(message.goal_tolerance),
        goal_time_tolerance_ns=_nanoseconds(message.goal_time_tolerance),
    )


def _point_message(point: TrajectoryPoint) -> Any:
    message = JointTrajectoryPoint(
        positions=point.positions,
        velocities=point.velocities,
        accelerations=point.accelerations,
        effort=point.effort,
    )
    message.time_from_start.sec, message.time_from_start.nanosec = divmod(point.time_from_start_ns, _NS)
    return message
