from __future__ import annotations

from throwcollect.report.outcomes import Outcomes, style_of
from throwcollect.tasks.result import REFUSED
from throwcollect.tasks.throw.throw_result import ThrowOutcome


def test_outcomes_have_a_fixed_order_with_unknown_ones_last() -> None:
    found = Outcomes.of(["lost", "landed", "odd", "self_hit", "landed"])
    assert found.names == ("landed", "self_hit", "lost", "odd")
    assert found.codes.tolist() == [2, 0, 3, 1, 0]
    assert found.succeeded == 2
    assert found.are("landed").tolist() == [False, True, False, False, True]
    assert found.are("recaught").tolist() == [False] * 5


def test_every_outcome_has_a_colour_of_its_own() -> None:
    names = (*(outcome.value for outcome in ThrowOutcome), REFUSED, "unheard of")
    assert len({style_of(name).colour for name in names}) == len(names)


def test_outcomes_of_another_task_have_different_styles() -> None:
    found = Outcomes.of(["swung", "stuck", "slipped", "lost", "stuck"], success="swung")
    assert found.names == ("swung", "lost", "slipped", "stuck")
    assert len({(found.style_of(name).colour, found.style_of(name).symbol) for name in found.names}) == 4
    assert found.style_of("swung") == style_of("landed")
    assert found.style_of("lost") == style_of("lost")
