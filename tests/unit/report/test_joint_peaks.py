from __future__ import annotations

import pyarrow as pa
import pytest

from throwcollect.report.joint_peaks import summarise_peaks


def test_peaks_are_grouped_by_the_joint_that_had_them() -> None:
    throws = pa.table(
        {"effort_peak_share": [0.5, 0.7, 1.0, None, 0.9], "effort_peak_joint": ["a", "a", "b", None, "a"]}
    )
    first, second = summarise_peaks(throws, "effort")
    assert (first.joint, first.count, first.quartiles, first.reached) == ("b", 1, (1.0,) * 5, 1)
    assert (second.joint, second.count, second.reached) == ("a", 3, 0)
    assert second.quartiles == pytest.approx((0.5, 0.6, 0.7, 0.8, 0.9))
