"""What tasks of other packages declare and return is checked where it is made."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from throwcollect.config.schema import Config
from throwcollect.tasks.result import Outcome, Result
from throwcollect.tasks.result_columns import Column
from throwcollect.tasks.returned import check_assessment, check_declared, check_trajectory, check_values
from throwcollect.tasks.task import Failure, task_of

COLUMNS = (
    Column("travel_m", "number", "How far."),
    Column("turns", "count", "How often."),
    Column("joint", "text", "Which one."),
)
GOOD: dict[str, Any] = {"travel_m": 1.5, "turns": 2, "joint": "elbow"}


class WaveOutcome(Outcome):
    """How a wave ended."""

    WAVED = "waved"
    SHORT = "short"


class OtherOutcome(Outcome):
    """Outcomes of another task."""

    SHORT = "short"


@dataclass(frozen=True)
class WaveResult(Result):
    """Result of a wave."""


RESULT = WaveResult(WaveOutcome.WAVED)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"travel_m": float("nan")},
            "travel_m should be a finite number, or None if there is nothing to measure; is nan",
        ),
        ({"travel_m": float("inf")}, "travel_m should be a finite number"),
        ({"travel_m": "far"}, "travel_m should be a number of Python or None, is 'far'"),
        ({"travel_m": True}, "travel_m should be a number of Python or None, is True"),
        ({"turns": 1.5}, "turns should be a whole number of Python or None, is 1.5"),
        ({"turns": np.int64(3)}, "turns should be a whole number of Python or None, is .*int64"),
        ({"turns": 2**63}, "turns should be a whole number of 64 bits, is 9223372036854775808"),
        ({"joint": 3}, "joint should be a text of Python or None, is 3"),
    ],
)
def test_a_value_of_a_wrong_kind_is_an_error_that_names_its_column(change: dict[str, Any], said: str) -> None:
    with pytest.raises((TypeError, ValueError), match=said):
        check_values(GOOD | change, COLUMNS)


def test_good_values_and_missing_ones_pass() -> None:
    check_values(GOOD, COLUMNS)
    check_values(GOOD | {"travel_m": np.float64(2.0)}, COLUMNS)
    check_values(dict.fromkeys(GOOD), COLUMNS)


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        (None, "assess should return a WaveResult and a Failure or None, returned None"),
        (RESULT, "assess should return a WaveResult and a Failure or None, returned a WaveResult"),
        ((Result(WaveOutcome.WAVED), None), "returned a Result and None"),
        ((RESULT, "short"), "returned a WaveResult and 'short'"),
        (
            (RESULT, Failure(OtherOutcome.SHORT, "why")),
            "outcome of a failure should be a WaveOutcome, is <OtherOutcome",
        ),
        ((RESULT, Failure(WaveOutcome.SHORT, 3)), "the reason of a failure should be a text, is 3"),  # type: ignore[arg-type]
    ],
)
def test_a_wrong_assessment_is_an_error_that_says_what_would_be_right(returned: object, said: str) -> None:
    with pytest.raises(TypeError, match=said):
        check_assessment(returned, WaveResult, WaveOutcome, Failure)


def test_right_assessments_pass() -> None:
    for failure in (None, Failure(WaveOutcome.SHORT, "too short")):
        check_assessment((RESULT, failure), WaveResult, WaveOutcome, Failure)


def test_a_wrong_trajectory_is_an_error_that_says_what_would_be_right() -> None:
    right = task_of(Config()).trajectory()
    check_trajectory(right, right.joints)
    wrong: list[tuple[Any, str]] = [
        (None, "trajectory should return a JointTrajectory, returned None"),
        (replace(right, joints=right.joints[::-1]), "the joints of the trajectory should be those of task.end"),
        (replace(right, positions=right.positions * np.nan), "positions of the trajectory hold numbers that are not"),
        (
            replace(right, velocities=right.velocities[1:]),
            r"velocities of the trajectory should have the shape \(26, 5\)",
        ),
        (replace(right, times=right.times[::-1]), "times of the trajectory should begin at 0 and increase"),
    ]
    for trajectory, said in wrong:
        with pytest.raises((TypeError, ValueError), match=said):
            check_trajectory(trajectory, right.joints)


def test_outcomes_and_results_have_to_be_classes_of_the_right_kind() -> None:
    check_declared(WaveOutcome, WaveResult)
    for outcomes, results, said in (
        (("waved",), WaveResult, "outcomes should be a class derived from throwcollect.tasks.result.Outcome, is"),
        (WaveOutcome, None, "results should be a class derived from throwcollect.tasks.result.Result, is None"),
    ):
        with pytest.raises(TypeError, match=said):
            check_declared(outcomes, results)
