from __future__ import annotations

from throwcollect.dataset.throws_table import REFUSED
from throwcollect.report.outcomes import Outcomes, style_of
from throwcollect.tasks.throw.outcome import ThrowOutcome


def test_outcomes_come_in_one_order_and_unknown_ones_last() -> None:
    found = Outcomes.of(["lost", "landed", "odd", "self_hit", "landed"])
    assert found.names == ("landed", "self_hit", "lost", "odd")
    assert found.codes.tolist() == [2, 0, 3, 1, 0]
    assert found.succeeded == 2
    assert found.are("landed").tolist() == [False, True, False, False, True]
    assert found.are("recaught").tolist() == [False] * 5


def test_every_outcome_is_drawn_in_a_way_of_its_own() -> None:
    styles = [style_of(name) for name in (*(outcome.value for outcome in ThrowOutcome), REFUSED, "unheard of")]
    for part in ("colour", "symbol"):
        assert len({getattr(style, part) for style in styles}) == len(styles)
