import itertools

import pytest

from rclzenoh.action.goals import (
    ABORTED,
    ACCEPTED,
    CANCELED,
    CANCELING,
    EXECUTING,
    SUCCEEDED,
    GoalInfo,
    GoalStatus,
    GoalTable,
    TrackedGoal,
)
from rclzenoh.interfaces.msg import UUID, Time

KEYS = [bytes([i]) * 16 for i in range(1, 5)]
NONE = bytes(16)


def info(key, second):
    return GoalInfo(goal_id=UUID(uuid=key), stamp=Time(sec=second))


@pytest.fixture
def table():
    """Four goals, accepted at 1 s, 2 s, 3 s and 4 s; the last one has been reached."""
    table = GoalTable(100)
    for second, key in enumerate(KEYS, 1):
        table[key] = TrackedGoal(info(key, second))
        table[key].become(EXECUTING, 0)
    table[KEYS[3]].become(SUCCEEDED, 50)
    return table


def test_a_goal_makes_only_the_transitions_of_the_state_machine():
    states = (ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED)
    moves = set()
    for before, after in itertools.product(states, states):
        goal = TrackedGoal(GoalInfo())
        goal.status = before
        if goal.can_become(after):
            goal.become(after, 0)
            moves.add((before, goal.status))
        else:
            with pytest.raises(RuntimeError, match="cannot go"):
                goal.become(after, 0)
    assert moves == {(1, 2), (1, 3), (2, 3), (2, 4), (2, 6), (3, 4), (3, 5), (3, 6)}


@pytest.mark.parametrize(
    ("key", "stamp_s", "code", "meant"),
    [
        (KEYS[1], 0, 0, [1]),
        (b"x" * 16, 0, 2, []),
        (KEYS[3], 0, 3, []),
        (NONE, 0, 0, [0, 1, 2]),
        (NONE, 2, 0, [0, 1]),
        (KEYS[2], 1, 0, [0, 2]),
        (b"x" * 16, 9, 0, [0, 1, 2]),
    ],
)
def test_a_cancel_request_selects_goals_as_the_protocol_says(table, key, stamp_s, code, meant):
    assert table.select(info(key, stamp_s)) == (code, [table[KEYS[i]] for i in meant])


def test_a_goal_that_is_being_cancelled_cannot_be_cancelled_again(table):
    table[KEYS[0]].become(CANCELING, 0)
    assert table.select(info(KEYS[0], 0)) == (3, [])


def test_goals_are_forgotten_some_time_after_their_end(table):
    goal = table[KEYS[3]]
    table.expire(150)
    assert list(table) == KEYS
    table.expire(151)
    assert goal.status == GoalStatus.STATUS_UNKNOWN
    assert list(table) == KEYS[:3]


def test_a_clock_that_was_turned_back_does_not_keep_goals_for_ever(table):
    table.expire(10)
    table.expire(110)
    assert list(table) == KEYS
    table.expire(111)
    assert list(table) == KEYS[:3]
