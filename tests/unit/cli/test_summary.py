"""The summary that a collection prints at its end."""

import pytest

from throwcollect.cli.dataset.info import describe
from throwcollect.dataset.summary import Info


@pytest.mark.parametrize(
    ("wanted", "said"),
    [(None, ""), (5, ""), (6, "; 6 should have landed, but all trials were used up")],
)
def test_the_summary_says_if_too_few_throws_landed(wanted: int | None, said: str) -> None:
    outcomes = {"landed": 5, "recaught": 2}
    found = Info("few", 7, 7, outcomes, wanted, None, 70, 1.0, 1, 10, 5, {"/clock": 7}, "0" * 64)
    assert describe(found).splitlines()[0] == f"trials    7: 5 landed, 2 recaught{said}"
