"""The goals of an action server: their states, and the ones that a request to cancel is about."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from rclzenoh.duration import S_TO_NS
from rclzenoh.interfaces.msg import GoalInfo, GoalStatus
from rclzenoh.interfaces.srv import CancelGoal

_ACCEPTED, _EXECUTING = GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING
_CANCELING, _SUCCEEDED = GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_SUCCEEDED
_CANCELED, _ABORTED = GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED


class GoalEvent(Enum):
    """An event that may change the state of a goal."""

    EXECUTE = "executed"
    CANCEL = "cancelled by request"
    SUCCEED = "reached"
    ABORT = "aborted"
    CANCELED = "finished as cancelled"


_MOVES = {
    (_ACCEPTED, GoalEvent.EXECUTE): _EXECUTING,
    (_ACCEPTED, GoalEvent.CANCEL): _CANCELING,
    (_EXECUTING, GoalEvent.CANCEL): _CANCELING,
    (_EXECUTING, GoalEvent.SUCCEED): _SUCCEEDED,
    (_EXECUTING, GoalEvent.ABORT): _ABORTED,
    (_CANCELING, GoalEvent.SUCCEED): _SUCCEEDED,
    (_CANCELING, GoalEvent.ABORT): _ABORTED,
    (_CANCELING, GoalEvent.CANCELED): _CANCELED,
}
"""The state machine of rcl_action (Jazzy)."""

_NAMES = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")


@dataclass
class TrackedGoal:
    """A goal that was accepted.

    Attributes:
        info: Identifier and time of acceptance.
        status: Of action_msgs/msg/GoalStatus; unknown once the goal is forgotten.
        ended_ns: Time at which it ended [ns]; None before.
    """

    info: GoalInfo
    status: int = _ACCEPTED
    ended_ns: int | None = None

    @property
    def is_active(self) -> bool:
        """Whether the goal has not ended."""
        return self.status in (_ACCEPTED, _EXECUTING, _CANCELING)


class GoalTable(dict[bytes, TrackedGoal]):
    """Goals by identifier, in order of acceptance.

    Args:
        result_timeout_ns: Time for which a goal is kept after its end [ns].
    """

    def __init__(self, result_timeout_ns: int) -> None:
        super().__init__()
        self._result_timeout_ns = result_timeout_ns

    def add(self, key: bytes, info: GoalInfo) -> TrackedGoal:
        """Accept a goal."""
        self[key] = TrackedGoal(info)
        return self[key]

    def can(self, key: bytes, event: GoalEvent) -> bool:
        """Whether an event is possible in the present state of a goal."""
        return key in self and (self[key].status, event) in _MOVES

    def change(self, key: bytes, event: GoalEvent, now_ns: int) -> None:
        """Change a goal's state.

        Raises:
            RuntimeError: If the event is not possible in its present state.
        """
        if not self.can(key, event):
            status = self[key].status if key in self else GoalStatus.STATUS_UNKNOWN
            raise RuntimeError(f"goal {key.hex()} is {_NAMES[status]} and cannot be {event.value}")
        goal = self[key]
        goal.status = _MOVES[goal.status, event]
        if not goal.is_active:
            goal.ended_ns = now_ns

    def select(self, key: bytes, stamp_ns: int) -> tuple[int, list[bytes]]:
        """Goals that a request to cancel is about.

        Args:
            key: Identifier in the request; all zeros for none.
            stamp_ns: Stamp in the request [ns]; 0 for none.

        Returns:
            Return code of action_msgs/srv/CancelGoal, and the identifiers of the goals.
        """
        # action_msgs/srv/CancelGoal has four cases: one goal, all goals, all up to a time, and these together with one
        # goal.
        has_key = any(key)
        if has_key and not stamp_ns:
            if key not in self:
                return CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, []
            if not self.can(key, GoalEvent.CANCEL):
                return CancelGoal.Response.ERROR_GOAL_TERMINATED, []
            return CancelGoal.Response.ERROR_NONE, [key]
        everything = not has_key and not stamp_ns
        selected = [
            other
            for other, goal in self.items()
            if self.can(other, GoalEvent.CANCEL) and (everything or other == key or _stamp_ns(goal) <= stamp_ns)
        ]
        return CancelGoal.Response.ERROR_NONE, selected

    def expire(self, now_ns: int) -> list[bytes]:
        """Forget the goals that ended long enough ago, and return their identifiers."""
        old = []
        for key, goal in self.items():
            if goal.ended_ns is None:
                continue
            # After a reset of the simulation the clock is behind the time of the end, so the wait begins anew.
            goal.ended_ns = min(goal.ended_ns, now_ns)
            if now_ns - goal.ended_ns > self._result_timeout_ns:
                old.append(key)
        for key in old:
            self.pop(key).status = GoalStatus.STATUS_UNKNOWN
        return old


def _stamp_ns(goal: TrackedGoal) -> int:
    stamp = goal.info.stamp
    return int(stamp.sec * S_TO_NS + stamp.nanosec)
