"""Groups of failures in a report."""

from __future__ import annotations

from throwcollect.report.sections import FailureGroup, group_failures


def test_failures_whose_reasons_differ_only_in_numbers_are_one_group() -> None:
    rows = [
        (0, "landed", None),
        (1, "refused", "arm_right_4_joint needs 12.5 Nm at 0.3 s"),
        (2, "self_hit", "the ball touched arm_right_7_link at 0.812 s"),
        (3, "refused", "arm_right_4_joint needs 14 Nm at -1e-3 s"),
    ]
    assert group_failures(rows) == (
        FailureGroup("refused", "arm_right_4_joint needs # Nm at # s", 2, (1, 3)),
        FailureGroup("self_hit", "the ball touched arm_right_7_link at 0.812 s", 1, (2,)),
    )
