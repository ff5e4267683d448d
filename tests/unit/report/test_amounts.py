from __future__ import annotations

import pytest

from throwcollect.report.amounts import format_duration, format_share, format_size


@pytest.mark.parametrize(
    ("count", "total", "text"),
    [(0, 7, "0 %"), (7, 7, "100 %"), (1, 100_000, "0.1 %"), (99_999, 100_000, "99.9 %"), (1, 3, "33.3 %")],
)
def test_a_share_is_shown_as_0_or_100_percent_only_if_it_is_exact(count: int, total: int, text: str) -> None:
    assert format_share(count, total) == text


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0 s"), (119, "119 s"), (120, "2.0 min"), (7200, "2.0 h")])
def test_a_duration_is_shown_in_seconds_minutes_or_hours(seconds: float, text: str) -> None:
    assert format_duration(seconds) == text


@pytest.mark.parametrize(("count", "text"), [(999_999, "1000 kB"), (1_000_000, "1.0 MB"), (2_500_000_000, "2.5 GB")])
def test_a_size_is_shown_in_decimal_units(count: int, text: str) -> None:
    assert format_size(count) == text
