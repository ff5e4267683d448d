"""Outcomes, failures and amounts as a report writes them."""

from __future__ import annotations

from throwcollect.publish.report.measured import Outcomes
from throwcollect.publish.report.sections import tabulate_failures
from throwcollect.tasks.outcome_styles import style_of
from throwcollect.tasks.result import REFUSED
from throwcollect.tasks.throw.throw_result import ThrowOutcome
from throwcollect.tasks.throw_into.into_result import IntoOutcome


def test_outcomes_have_a_fixed_order_with_unknown_ones_last() -> None:
    found = Outcomes.of(["lost", "landed", "odd", "self_hit", "landed"], list(ThrowOutcome))
    assert found.names == ("landed", "self_hit", "lost", "odd")
    assert found.codes.tolist() == [2, 0, 3, 1, 0]
    assert found.succeeded == 2
    assert found.are("landed").tolist() == [False, True, False, False, True]
    assert found.are("recaught").tolist() == [False] * 5


def test_every_outcome_of_a_task_has_a_colour_of_its_own() -> None:
    for task in (ThrowOutcome, IntoOutcome):
        found = Outcomes.of([*(outcome.value for outcome in task), REFUSED, "unheard of"], list(task))
        assert found.names[0] == found.success
        styles = [found.style_of(name) for name in found.names]
        assert styles[0] == style_of("landed")
        for looks in ({each.colour for each in styles}, {each.symbol for each in styles}):
            assert len(looks) == len(styles)
        # An outcome looks the same whichever others occur.
        assert Outcomes.of(["self_hit"], list(task)).style_of("self_hit") == found.style_of("self_hit")


def test_failures_whose_reasons_differ_only_in_numbers_are_one_group() -> None:
    rows = [
        (0, "landed", None),
        (1, "refused", "arm_right_4_joint needs 12.5 Nm at 0.3 s"),
        (2, "self_hit", "the ball touched arm_right_7_link at 0.812 s"),
        (3, "refused", "arm_right_4_joint needs 14 Nm at -1e-3 s"),
    ]
    table = tabulate_failures(rows)
    assert table is not None
    assert table.rows == (
        ("refused", "arm_right_4_joint needs # Nm at # s", "2", "1, 3"),
        ("self hit", "the ball touched arm_right_7_link at 0.812 s", "1", "2"),
    )
    assert tabulate_failures(rows[:1]) is None
