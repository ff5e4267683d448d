"""The FollowJointTrajectory action of one controller."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import Any

from throwcollect.control.values import (
    ControllerState,
    GoalResult,
    GoalStatus,
    JointTolerance,
    Trajectory,
    TrajectoryGoal,
    TrajectoryPoint,
)
from throwcollect.ros import ActionServer, CancelResponse, Future, GoalResponse, Node
from throwcollect.ros.action import FollowJointTrajectory
from throwcollect.ros.msg import Duration, JointTrajectory, JointTrajectoryControllerState, JointTrajectoryPoint, Time
from throwcollect.ros.msg import JointTolerance as JointToleranceMessage
from throwcollect.sim.live import LiveSimulator
from throwcollect.units import NS_PER_S

_LONGEST_NS = 2**31 * NS_PER_S - 1
"""Largest time that a message can hold [ns]: its seconds have 32 bits, one of them for the sign."""

_RESULT_TIMEOUT_S = 10
"""How long clients can ask for a result, in simulated time; rcl has the same default."""


@dataclass
class _Goal:
    """A goal that the controller has taken; the action server gives its handle later."""

    result: Future
    handle: Any = None
    feedback: list[Any] = field(default_factory=list)
    """Messages that cannot be sent before the handle is there."""


class ControllerAction:
    """Takes goals for a controller, and sends feedback and results.

    Args:
        node: The controller's node.
        simulation: The simulation.
        controller: Name of the controller in the simulation.
        aborts_refused: Whether goals that cannot be executed are accepted and then aborted with the reason, instead of
            being rejected.
    """

    def __init__(self, node: Node, simulation: LiveSimulator, controller: str, *, aborts_refused: bool) -> None:
        self._node = node
        self._simulation = simulation
        self._controller = controller
        self._aborts_refused = aborts_refused
        self._count = 0
        self._published_ns = 0
        self._goals: dict[Hashable, _Goal] = {}
        """The goals whose results have not been sent, by their ids in the simulation, the oldest first."""
        name = f"{node.get_name()}/follow_joint_trajectory"
        self._feedback_topic = f"{name}/_action/feedback"
        self._server = ActionServer(
            node,
            FollowJointTrajectory,
            name,
            execute_callback=self._execute,
            goal_callback=self._consider,
            handle_accepted_callback=self._accept,
            cancel_callback=self._cancel,
            result_timeout=_RESULT_TIMEOUT_S,
        )

    def finish(self, result: GoalResult) -> None:
        """Send the result of a goal to the client that waits for it."""
        if (goal := self._goals.get(result.goal_id)) is not None:
            goal.result.set_result(result)

    @property
    def watched(self) -> bool:
        """Whether a goal has been taken and feedback has subscribers."""
        return bool(self._goals) and self._node.count_subscribers(self._feedback_topic) > 0

    @property
    def owes_feedback(self) -> bool:
        """Whether feedback has subscribers, and enough simulated time has passed since the last message."""
        passed_ns = self._simulation.now_ns - self._published_ns
        # After a reset, the clock may show less than the time of the last message; feedback is due then, too.
        return passed_ns != 0 and not 0 < passed_ns < self._simulation.feedback_ns and self.watched

    def publish_feedback(self, state: ControllerState) -> None:
        """Send feedback on all goals."""
        passed_ns = self._simulation.now_ns - self._published_ns
        # Note when the feedback was due, which may be in the middle of a stretch, so that delays do not add up.
        self._published_ns += passed_ns - passed_ns % (self._simulation.feedback_ns or 1)
        feedback = feedback_message(state)
        for goal in self._goals.values():
            # A goal that has ended gets no more feedback, even if it ended in the middle of the last stretch.
            if goal.result.done():
                continue
            if goal.handle is None:
                goal.feedback.append(feedback)
            else:
                goal.handle.publish_feedback(feedback)

    def _consider(self, request: FollowJointTrajectory.Goal) -> GoalResponse:
        # The controller takes the goal here, because only the controller can tell whether the goal is acceptable. The
        # handles come in the same order, but perhaps after the next goal was taken, or after this goal has ended.
        refusal = self._simulation.submit(self._controller, self._count + 1, read_goal(request))
        if refusal is not None and not self._aborts_refused:
            return GoalResponse.REJECT
        self._count += 1
        # Send no feedback until simulated time has passed since the goal was accepted.
        self._published_ns = self._simulation.now_ns
        self._goals[self._count] = _Goal(Future())
        if refusal is not None:
            self.finish(GoalResult(GoalStatus.ABORTED, refusal.error_code, refusal.text, self._count))
        return GoalResponse.ACCEPT

    def _accept(self, handle: Any) -> None:
        goal = next(goal for goal in self._goals.values() if goal.handle is None)
        goal.handle = handle
        for feedback in goal.feedback:
            handle.publish_feedback(feedback)
        handle.execute()

    def _cancel(self, handle: Any) -> CancelResponse:
        # The client gets the result of the cancelled goal when its execution goes on, after this answer.
        key = self._find_key(handle)
        cancelled = key is not None and self._simulation.cancel(self._controller, key)
        return CancelResponse.ACCEPT if cancelled else CancelResponse.REJECT

    async def _execute(self, handle: Any) -> FollowJointTrajectory.Result:
        key = self._find_key(handle)
        result: GoalResult = await self._goals[key].result
        del self._goals[key]
        if result.status == GoalStatus.SUCCEEDED:
            handle.succeed()
        elif result.status == GoalStatus.CANCELED:
            handle.canceled()
        else:
            handle.abort()
        return FollowJointTrajectory.Result(error_code=int(result.error_code), error_string=result.error_string)

    def _find_key(self, handle: Any) -> Hashable | None:
        return next((key for key, goal in self._goals.items() if goal.handle is handle), None)


def nanoseconds(time: Time | Duration) -> int:
    """Convert a builtin_interfaces Time or Duration to nanoseconds."""
    return int(time.sec) * NS_PER_S + int(time.nanosec)


def read_trajectory(message: JointTrajectory) -> Trajectory:
    """Read the contents of a trajectory_msgs/msg/JointTrajectory."""
    stamp_ns = nanoseconds(message.header.stamp)
    points = message.points
    return Trajectory(
        joint_names=tuple(message.joint_names),
        times_ns=[nanoseconds(point.time_from_start) for point in points],
        positions=[point.positions for point in points],
        velocities=[point.velocities for point in points],
        accelerations=[point.accelerations for point in points],
        effort=[point.effort for point in points],
        # A stamp of zero is ROS' way of leaving it out.
        stamp_ns=stamp_ns or None,
    )


def read_goal(message: FollowJointTrajectory.Goal) -> TrajectoryGoal:
    """Read the contents of a FollowJointTrajectory goal, without the fields that ros2_controllers ignores."""
    return TrajectoryGoal(
        trajectory=read_trajectory(message.trajectory),
        path_tolerance=_read_tolerances(message.path_tolerance),
        goal_tolerance=_read_tolerances(message.goal_tolerance),
        goal_time_tolerance_ns=nanoseconds(message.goal_time_tolerance),
    )


def state_message(state: ControllerState) -> JointTrajectoryControllerState:
    """Make a control_msgs/msg/JointTrajectoryControllerState."""
    message = JointTrajectoryControllerState(
        joint_names=list(state.joint_names),
        # Upstream copies all else of it; feedback of a goal has the efforts, too.
        reference=_point_message(replace(state.desired, effort=())),
        feedback=_point_message(state.actual),
        error=_point_message(state.error),
        output=_point_message(state.output),
        speed_scaling_factor=float(state.speed_scaling_factor),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, NS_PER_S)
    return message


def feedback_message(state: ControllerState) -> FollowJointTrajectory.Feedback:
    """Make a feedback message of FollowJointTrajectory."""
    message = FollowJointTrajectory.Feedback(
        joint_names=list(state.joint_names),
        desired=_point_message(state.desired),
        actual=_point_message(state.actual),
        error=_point_message(state.error),
    )
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(state.stamp_ns, NS_PER_S)
    return message


def _read_tolerances(messages: list[JointToleranceMessage]) -> tuple[JointTolerance, ...]:
    return tuple(
        JointTolerance(message.name, message.position, message.velocity, message.acceleration) for message in messages
    )


def _point_message(point: TrajectoryPoint) -> JointTrajectoryPoint:
    message = JointTrajectoryPoint(
        positions=point.positions,
        velocities=point.velocities,
        accelerations=point.accelerations,
        effort=point.effort,
    )
    # A trajectory with a stamp of decades ago can have been going on for longer than a message can hold.
    passed_ns = min(point.time_from_start_ns, _LONGEST_NS)
    message.time_from_start.sec, message.time_from_start.nanosec = divmod(passed_ns, NS_PER_S)
    return message
