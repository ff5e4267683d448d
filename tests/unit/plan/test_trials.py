"""Trials in columns behave as a list of single trials."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.unit.plan.columns import in_columns

from throwcollect.plan.trials import Trial, Trials

LISTED = [
    Trial(
        number, {"ball.mass_kg": number / 7, "task.duration_s": 1.0}, 2**64 - 1 - number, f"{number**9:064x}", refused
    )
    for number, refused in enumerate((None, "too fast", None, None, "too far"))
]


def trials() -> Trials:
    return in_columns(LISTED)


def test_trials_in_columns_behave_as_a_sequence() -> None:
    assert list(trials()) == LISTED
    assert [trials()[index] for index in range(-5, 5)] == LISTED + LISTED
    assert list(trials()[1:4]) == list(trials()[1:][:3]) == LISTED[1:4]
    assert list(trials().numbers_to_run) == [0, 2, 3]
    assert list(trials()[3:].numbers_to_run) == [3]
    with pytest.raises(IndexError):
        trials()[5]
    with pytest.raises(ValueError, match="no gaps"):
        trials()[::2]


@pytest.mark.parametrize("changed", [{"seed": 1}, {"digest": "0" * 64}, {"refused": "too slow"}])
def test_trials_in_columns_are_equal_only_if_all_their_fields_are(changed: dict[str, object]) -> None:
    assert trials() == trials()
    assert trials()[1:] != trials()[:4]
    other = [*LISTED[:4], replace(LISTED[4], **changed)]  # type: ignore[arg-type]
    assert in_columns(other) != trials()
    assert in_columns([*LISTED[:4], replace(LISTED[4], values={"ball.mass_kg": 4 / 7, "task.duration_s": 2.0})]) != (
        trials()
    )
