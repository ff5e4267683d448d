"""The goals of an action server: their states, and the choice of goals for a request to cancel."""

from __future__ import annotations

from typing import Any

from rclzenoh.interfaces.msg import UUID, GoalInfo, GoalStatus
from rclzenoh.interfaces.srv import CancelGoal
from rclzenoh.time import Time

ACCEPTED, EXECUTING, CANCELING = GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING
SUCCEEDED, CANCELED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED
ABORTED = GoalStatus.STATUS_ABORTED

_NEXT = {
    ACCEPTED: (EXECUTING, CANCELING),
    EXECUTING: (CANCELING, SUCCEEDED, ABORTED),
    CANCELING: (SUCCEEDED, ABORTED, CANCELED),
}
"""States that follow each state in the state machine of rcl_action (Jazzy)."""


class TrackedGoal:
    """A goal that was accepted, and its state.

    Attributes:
        info: Identifier and time of acceptance.
        status: Of action_msgs/msg/GoalStatus; unknown once the goal is forgotten.
        ended_ns: Time at which it ended [ns]; None before.
    """

    def __init__(self, info: GoalInfo) -> None:
        self.info = info
        self.status: int = ACCEPTED
        self.ended_ns: int | None = None

    @property
    def is_active(self) -> bool:
        """Whether the goal has not ended."""
        return self.status in _NEXT

    def can_become(self, status: int) -> bool:
        """Whether a state may follow the present one."""
        return status in _NEXT.get(self.status, ())

    def become(self, status: int, now_ns: int) -> None:
        """Change the state."""
        if not self.can_become(status):
            raise RuntimeError(f"a goal cannot go from status {self.status} to {status}")
        self.status = status
        if not self.is_active:
            self.ended_ns = now_ns


class GoalTable(dict[bytes, Any]):
    """Goals by identifier, in order of acceptance.

    Args:
        result_timeout_ns: Time for which a goal is kept after its end [ns].
    """

    def __init__(self, result_timeout_ns: int) -> None:
        super().__init__()
        self._result_timeout_ns = result_timeout_ns

    def select(self, asked: GoalInfo) -> tuple[int, list[Any]]:
        """Select the goals that a request to cancel names; the first value is a code of action_msgs/srv/CancelGoal."""
        # action_msgs/srv/CancelGoal has four cases: one goal, all goals, all goals up to a time, and all goals up to a
        # time together with one goal.
        key, stamp_ns = key_of(asked.goal_id), Time.from_msg(asked.stamp).nanoseconds
        has_key = any(key)
        if has_key and not stamp_ns:
            if key not in self:
                return CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, []
            if not self[key].can_become(CANCELING):
                return CancelGoal.Response.ERROR_GOAL_TERMINATED, []
            return CancelGoal.Response.ERROR_NONE, [self[key]]
        everything = not has_key and not stamp_ns
        selected = [
            goal
            for other, goal in self.items()
            if goal.can_become(CANCELING)
            and (everything or other == key or Time.from_msg(goal.info.stamp).nanoseconds <= stamp_ns)
        ]
        return CancelGoal.Response.ERROR_NONE, selected

    def expire(self, now_ns: int) -> None:
        """Forget the goals that ended long enough ago."""
        for key, goal in list(self.items()):
            if goal.ended_ns is None:
                continue
            # After a reset of the simulation, the clock may show an earlier time than that of the end; then the timeout
            # begins anew.
            goal.ended_ns = min(goal.ended_ns, now_ns)
            if now_ns - goal.ended_ns > self._result_timeout_ns:
                self.pop(key).status = GoalStatus.STATUS_UNKNOWN


def key_of(goal_id: UUID) -> bytes:
    """The 16 octets of an identifier."""
    return bytes(goal_id.uuid)
