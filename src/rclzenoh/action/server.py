"""Action servers."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import Any

from rclzenoh.action import goals
from rclzenoh.action.goals import GoalTable, TrackedGoal, key_of
from rclzenoh.interfaces import Action, AnyMessage, Message
from rclzenoh.interfaces.msg import UUID, GoalInfo, GoalStatus, GoalStatusArray
from rclzenoh.interfaces.srv import CancelGoal
from rclzenoh.node import Node
from rclzenoh.qos import QoSProfile, qos_profile_action_status_default
from rclzenoh.task import Future, submit
from rclzenoh.time import S_TO_NS

_RESULT_TIMEOUT_S = 900


class GoalResponse(Enum):
    """Answers to a goal."""

    REJECT = 1
    ACCEPT = 2


class CancelResponse(Enum):
    """Answers to a request to cancel a goal."""

    REJECT = 1
    ACCEPT = 2


class ServerGoalHandle(TrackedGoal):
    """An accepted goal, as its server sees it."""

    def __init__(self, server: ActionServer, info: GoalInfo, request: Message) -> None:
        super().__init__(info)
        self._server = server
        self.request = request
        self.result_future = Future()

    @property
    def goal_id(self) -> UUID:
        """Identifier of the goal."""
        return self.info.goal_id

    @property
    def is_cancel_requested(self) -> bool:
        """Whether the goal is to be cancelled."""
        return self.status == goals.CANCELING

    def execute(self) -> None:
        """Let the executor call the execute callback."""
        if not self.is_cancel_requested:
            self._server.change(self, goals.EXECUTING)
        submit(self._server.node.mailbox, partial(self._server.carry_out, self))

    def publish_feedback(self, feedback: Message) -> None:
        """Publish feedback."""
        self._server.publish_feedback(self, feedback)

    def succeed(self) -> None:
        """End the goal as reached; the execute callback returns the result."""
        self._server.change(self, goals.SUCCEEDED)

    def abort(self) -> None:
        """End the goal as failed."""
        self._server.change(self, goals.ABORTED)

    def canceled(self) -> None:
        """End the goal as cancelled."""
        self._server.change(self, goals.CANCELED)


class ActionServer:
    """Carries out goals.

    The execute callback may be a coroutine function; other callbacks are called while it waits.

    Args:
        node: Node that the server belongs to.
        action_type: Class of the action.
        action_name: Its absolute, relative or private name.
        execute_callback: Called with the goal handle, returns the result.
        goal_callback: Called with the goal, returns a `GoalResponse`; by default, every goal is accepted.
        handle_accepted_callback: Called with the goal handle of an accepted goal; by default, it executes at once.
        cancel_callback: Called with the goal handle, returns a `CancelResponse`; by default, no goal is cancelled.
        result_timeout: Time for which a result is kept [s], on the node's clock.
    """

    def __init__(
        self,
        node: Node,
        action_type: type[Action],
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        goal_callback: Callable[[Any], Any] = lambda _: GoalResponse.ACCEPT,
        handle_accepted_callback: Callable[[ServerGoalHandle], Any] = ServerGoalHandle.execute,
        cancel_callback: Callable[[ServerGoalHandle], Any] = lambda _: CancelResponse.REJECT,
        result_timeout: float = _RESULT_TIMEOUT_S,
    ) -> None:
        self.node = node
        self.action_type = action_type
        self._execute_callback = execute_callback
        self._goal_callback = goal_callback
        self._handle_accepted_callback = handle_accepted_callback
        self._cancel_callback = cancel_callback
        self._logger = node.get_logger()
        self._goals = GoalTable(int(result_timeout * S_TO_NS))
        protocol, prefix = action_type.Impl, f"{action_name}/_action"
        self._services = [
            node.create_service(protocol.SendGoalService, f"{prefix}/send_goal", self._on_goal),
            node.create_service(CancelGoal, f"{prefix}/cancel_goal", self._on_cancel),
            node.create_service(protocol.GetResultService, f"{prefix}/get_result", self._on_result),
        ]
        self._feedback = node.create_publisher(protocol.FeedbackMessage, f"{prefix}/feedback", QoSProfile(depth=10))
        self._status = node.create_publisher(GoalStatusArray, f"{prefix}/status", qos_profile_action_status_default)

    def destroy(self) -> None:
        """Withdraw the server; clients get no more results."""
        for service in self._services:
            self.node.destroy_service(service)
        self.node.destroy_publisher(self._feedback)
        self.node.destroy_publisher(self._status)
        self._goals.clear()

    def change(self, handle: ServerGoalHandle, status: int) -> None:
        """Change a goal's state, and publish it."""
        handle.become(status, self._read_clock_ns())
        self._publish_status()

    def publish_feedback(self, handle: ServerGoalHandle, feedback: Message) -> None:
        """Publish feedback of a goal."""
        self._feedback.publish(self.action_type.Impl.FeedbackMessage(goal_id=handle.goal_id, feedback=feedback))

    async def carry_out(self, handle: ServerGoalHandle) -> None:
        """Call the execute callback of a goal, and answer those who wait for its result."""
        try:
            result = self._execute_callback(handle)
            if hasattr(result, "__await__"):
                result = await result
        except GeneratorExit:
            raise  # The executor has ended, so no result can be sent any more.
        except BaseException:
            # Clients that wait for a result must get one, even after an error.
            self._abort_if_active(handle, "failed")
            self._set_result(handle, self.action_type.Result())
            raise
        self._abort_if_active(handle, "returned")
        self._set_result(handle, self.action_type.Result() if result is None else result)

    def _set_result(self, handle: ServerGoalHandle, result: Message) -> None:
        response = self.action_type.Impl.GetResultService.Response(status=handle.status, result=result)
        handle.result_future.set_result(response)

    def _abort_if_active(self, handle: ServerGoalHandle, how: str) -> None:
        if handle.is_active:
            self._logger.warning(
                f"the execute callback {how} without ending goal {key_of(handle.goal_id).hex()}: aborted"
            )
            # The state machine has no transition from accepted to aborted, so the goal is executed in between.
            if handle.status == goals.ACCEPTED:
                self.change(handle, goals.EXECUTING)
            handle.abort()

    def _on_goal(self, request: AnyMessage, response: AnyMessage) -> Message:
        now = self.node.get_clock().now()
        self._goals.expire(now.nanoseconds)
        key = key_of(request.goal_id)
        response.accepted = key not in self._goals and self._goal_callback(request.goal) is GoalResponse.ACCEPT
        if response.accepted:
            response.stamp = now.to_msg()
            info = GoalInfo(goal_id=request.goal_id, stamp=response.stamp)
            self._goals[key] = ServerGoalHandle(self, info, request.goal)
            # It begins in another task, so that the client gets the response before the goal's first state.
            submit(self.node.mailbox, partial(self._begin, self._goals[key]))
        return response

    def _begin(self, handle: ServerGoalHandle) -> None:
        self._publish_status()
        self._handle_accepted_callback(handle)

    def _on_cancel(self, request: CancelGoal.Request, response: CancelGoal.Response) -> Message:
        self._goals.expire(self._read_clock_ns())
        response.return_code, handles = self._goals.select(request.goal_info)
        canceling = []
        for handle in handles:
            if self._cancel_callback(handle) is CancelResponse.ACCEPT:
                handle.become(goals.CANCELING, self._read_clock_ns())
                canceling.append(handle.info)
        if canceling:
            self._publish_status()
        elif handles:
            response.return_code = CancelGoal.Response.ERROR_REJECTED
        response.goals_canceling = canceling
        return response

    async def _on_result(self, request: AnyMessage, response: AnyMessage) -> Message:
        self._goals.expire(self._read_clock_ns())
        handle = self._goals.get(key_of(request.goal_id))
        if handle is None:
            response.status = GoalStatus.STATUS_UNKNOWN
            return response
        result: Message = await handle.result_future
        return result

    def _publish_status(self) -> None:
        self._goals.expire(self._read_clock_ns())
        status_list = [GoalStatus(goal_info=goal.info, status=goal.status) for goal in self._goals.values()]
        self._status.publish(GoalStatusArray(status_list=status_list))

    def _read_clock_ns(self) -> int:
        return self.node.get_clock().now().nanoseconds
