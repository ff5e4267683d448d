from __future__ import annotations

import pytest

from throwcollect.report.amounts import format_duration, format_share, format_size


@pytest.mark.parametrize(
    ("count", "total", "text"),
    [(0, 7, "0 %"), (7, 7, "100 %"), (1, 100_000, "0.1 %"), (99_999, 100_000, "99.9 %"), (1, 3, "33.3 %")],
)
def test_only_all_is_100_percent_and_only_none_is_0(count: int, total: int, text: str) -> None:
    assert format_share(count, total) == text


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0 s"), (119, "119 s"), (120, "2.0 min"), (7200, "2.0 h")])
def test_durations_have_the_unit_that_keeps_them_short(seconds: float, text: str) -> None:
    assert format_duration(seconds) == text


@pytest.mark.parametrize(("count", "text"), [(999_999, "1000 kB"), (1_000_000, "1.0 MB"), (2_500_000_000, "2.5 GB")])
def test_sizes_are_decimal(count: int, text: str) -> None:
    assert format_size(count) == text
